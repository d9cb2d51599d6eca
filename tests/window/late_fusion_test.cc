// Groups that come after their states have left: on linear problems the window is the batch, late groups included.
#include <gtest/gtest.h>

#include "linear_window.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/window/late_fusion.h"

namespace oriel {
namespace {

using namespace linear_world;
using Status = WindowUpdate::Status;

constexpr double kExact = 1e-9;

// A short window whose late groups are folded.
struct LateWindow : LinearWindow {
  LateFusion* late = nullptr;
  explicit LateWindow(int most_states, unsigned seed, double memory_s, const LateLedgerOptions& options = {})
      : LinearWindow(most_states, seed) {
    auto fusion = std::make_unique<LateFusion>(options);
    late = fusion.get();
    window.set(std::move(fusion));
    window.remember(Duration::from_seconds(memory_s));
  }
  // On time: what keeps the window moving.
  void frame(int k) {
    move_to(100 * k + 100);
    give({position_at(100 * k)});
    if (k >= 2) give({step(100 * (k - 2), 100 * k)});
    give({sight(100 * k, k / 6), sight(100 * k, k / 6 + 1)});
    if (k % 2 == 0) give({level_at(100 * k), offset_at(100 * k)});
  }
};

// W7, W8
TEST(LateFusion, EqualsTheBatchForTimesThatHadAState) {
  LateWindow w(4, 11, 10.0);
  int late = 0;
  for (int k = 0; k < 60; ++k) {
    w.frame(k);
    for (int i = 0; k > 8 && i < 2; ++i) {
      const std::int64_t old = 100 * w.any(k);
      w.give({i == 0 ? w.position_at(old) : w.level_at(old - old % 200)});
    }
    if (k > 8) w.give({w.step(100 * w.any(k / 2), 100 * (k / 2 + w.any(k / 2)) + 100 * (k % 2 == 0))});
    const WindowUpdate& update = w.window.update();
    ASSERT_EQ(update.status, Status::updated) << update.error.message;
    EXPECT_EQ(update.refused, 0);
    late += update.late;
    ASSERT_LT(k % 5 == 4 ? w.error() : 0.0, kExact) << "at update " << k;
  }
  EXPECT_GT(late, 100);
  EXPECT_EQ(w.late->states_made(), 0);
}

// W7
TEST(LateFusion, EqualsTheBatchForTimesThatNeverHadAState) {
  LateWindow w(5, 12, 20.0);
  int late = 0;
  for (int k = 0; k < 60; ++k) {
    w.frame(k);
    for (int i = 0; k > 10 && i < 3; ++i) {
      const std::int64_t old = 1 + w.any(100 * k - 200);
      w.give({i == 0 ? w.position_at(old) : i == 1 ? w.level_at(old) : w.tie(old, std::max<std::int64_t>(1, old - 7))});
    }
    const WindowUpdate& update = w.window.update();
    ASSERT_EQ(update.status, Status::updated) << update.error.message;
    EXPECT_EQ(update.refused, 0) << update.error.message;
    late += update.late;
    ASSERT_LT(k % 5 == 4 ? w.error() : 0.0, kExact) << "at update " << k;
  }
  EXPECT_GT(late, 100);
  EXPECT_GT(w.late->states_made(), 100);
}

// W7: older than the horizon, older than all states, motions that are forgotten, landmarks of its own.
TEST(LateFusion, RefusesWholeWhatItCannotFoldAndCountsIt) {
  LateWindow w(4, 13, 1.0, {.horizon = Duration::from_seconds(2.0)});
  for (int k = 0; k < 60; ++k) {
    w.frame(k);
    ASSERT_EQ(w.window.update().status, Status::updated);
  }
  const std::uint64_t before = fingerprint(w.window.graph());
  const std::size_t kept = w.late->kept().size();
  w.give({w.position_at(1000)});                       // beyond the horizon
  w.give({w.position_at(3650)});                       // a new state: its motion is forgotten, states are not
  w.give({w.sight(5000, 40)});                         // brings a landmark
  w.give({w.position_at(5000), w.position_at(1000)});  // one of two
  const WindowUpdate& update = w.window.update();
  EXPECT_EQ(update.refusals[0][Refusal::too_old], 4);
  EXPECT_EQ(update.late, 0);
  EXPECT_EQ(w.builder->refusals, 4);
  EXPECT_EQ(fingerprint(w.window.graph()), before);
  EXPECT_EQ(w.late->kept().size(), kept);
  EXPECT_EQ(w.late->refused(LateFusion::Reason::new_variables), 1);
  EXPECT_GE(w.late->refused(LateFusion::Reason::no_motion), 1);
  w.give({w.position_at(5000)});
  EXPECT_EQ(w.window.update().late, 1);
  EXPECT_LT(w.error(), kExact);
}

// W13: what is kept for late groups does not grow.
TEST(LateFusion, KeepsNoMoreThanItsHorizon) {
  LateWindow w(4, 14, 1.0, {.conditionals = 12, .horizon = Duration::from_seconds(5.0)});
  for (int k = 0; k < 80; ++k) {
    w.frame(k);
    if (k > 20) w.give({w.position_at(100 * (k - 8))});
    ASSERT_EQ(w.window.update().status, Status::updated);
    EXPECT_LE(w.late->kept().size(), 12u);
  }
  EXPECT_LT(w.position->moved.size(), 20u);
  EXPECT_LT(w.error(), kExact);
}

}  // namespace
}  // namespace oriel
