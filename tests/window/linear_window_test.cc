// On linear problems a window that slides says what dense least squares over everything that ever came says.
#include <gtest/gtest.h>

#include <algorithm>

#include "linear_window.h"

namespace oriel {
namespace {

using namespace linear_world;
using Status = WindowUpdate::Status;

constexpr double kExact = 1e-9;

// What a drive sees every 100 ms: positions now and then, steps back, landmarks that come and stay, levels, ties.
std::vector<MeasuredGroup> frame(LinearWindow& w, int k) {
  const std::int64_t now = 100 * k;
  std::vector<MeasuredGroup> out;
  if (k % 4 == 0) out.push_back({w.position_at(now)});
  if (k >= 2) out.push_back({w.step(now - 200, now)});
  out.push_back({w.sight(now, k / 6), w.sight(now, k / 6 + 1)});
  if (k % 2 == 0) out.push_back({w.level_at(now)});
  if (k % 3 == 0) out.push_back({w.tie(now, now), w.offset_at(now)});
  return out;
}

// W12
TEST(LinearWindow, EqualsTheBatchWhenDataComesInOrder) {
  LinearWindow w(5);
  for (int k = 0; k < 40; ++k) {
    w.move_to(100 * k + 100);
    for (auto& group : frame(w, k)) w.give(std::move(group));
    const WindowUpdate& update = w.window.update();
    ASSERT_EQ(update.status, Status::updated) << update.error.message;
    EXPECT_EQ(update.refused, 0);
    ASSERT_LT(k % 5 == 4 ? w.error() : 0.0, kExact) << "at frame " << k;
  }
  EXPECT_EQ(w.window.states().timeline(w.positions).size(), 5u);
  EXPECT_GT(w.window.graph().priors().slots().size(), 0u);
}

// W12, W14
TEST(LinearWindow, EqualsTheBatchWhenItSlidesBeforeItSolves) {
  WindowOptions options = LinearWindow::exact();
  options.slide_before_solve = true;
  LinearWindow w(4, 2, options);
  for (int k = 0; k < 30; ++k) {
    w.move_to(100 * k + 100);
    for (auto& group : frame(w, k)) w.give(std::move(group));
    ASSERT_EQ(w.window.update().status, Status::updated);
    ASSERT_LT(k % 5 == 4 ? w.error() : 0.0, kExact) << "at frame " << k;
  }
}

// W8
TEST(LinearWindow, EqualsTheBatchWhenDataComesOutOfOrder) {
  LinearWindow w(8, 3);
  std::vector<std::vector<MeasuredGroup>> arrivals(60);
  for (int k = 0; k < 50; ++k)
    for (auto& group : frame(w, k)) arrivals[k + (k == 0 ? 0 : w.any(5))].push_back(std::move(group));
  for (int k = 0; k < 60; ++k) {
    w.move_to(100 * k + 100);
    std::shuffle(arrivals[k].begin(), arrivals[k].end(), w.random);
    for (auto& group : arrivals[k]) w.give(std::move(group));
    const WindowUpdate& update = w.window.update();
    ASSERT_TRUE(update.status == Status::updated || update.status == Status::nothing_new) << update.error.message;
    ASSERT_LT(k % 5 == 4 ? w.error() : 0.0, kExact) << "at update " << k;
  }
  EXPECT_GT(w.builder->taken.size(), 150u);
}

// W8: stamps of their own, so that motions are split many times.
TEST(LinearWindow, EqualsTheBatchWhenStatesComeBetweenOthers) {
  LinearWindow w(10, 4);
  int entered = 0, refused = 0;
  for (int k = 0; k < 60; ++k) {
    w.move_to(100 * k + 100);
    w.give({w.position_at(100 * k)});
    for (int i = 0; i < 3; ++i) {
      const std::int64_t ms = 100 * k - w.any(400);
      if (ms > 0) w.give({i == 0 ? w.position_at(ms) : i == 1 ? w.level_at(ms) : w.tie(ms, std::max<int>(0, ms - 7))});
    }
    const WindowUpdate& update = w.window.update();
    ASSERT_EQ(update.status, Status::updated) << update.error.message;
    entered += update.entered, refused += update.refused;
    ASSERT_LT(k % 5 == 4 ? w.error() : 0.0, kExact) << "at update " << k;
  }
  EXPECT_GT(entered, 100);
  EXPECT_GT(refused, 0);  // some came too late
  EXPECT_EQ(w.window.refusals()[0][Refusal::too_old], refused);
}

// W5: the providers' own measurements come late.
TEST(LinearWindow, EqualsTheBatchWhenMotionsCannotBeHadYet) {
  LinearWindow w(6, 5);
  w.move_to(50);
  for (int k = 0; k < 40; ++k) {
    for (auto& group : frame(w, k)) w.give(std::move(group));
    if (k % 3 == 2)
      for (int i = 2; i >= 0; --i) w.move_to(100 * (k - i) + 60);
    const WindowUpdate& update = w.window.update();
    if (k > 0) {
      EXPECT_EQ(update.waiting > 0, k % 3 != 2);
    }
    ASSERT_LT(k % 5 == 4 ? w.error() : 0.0, kExact) << "at update " << k;
  }
}

// W13
TEST(LinearWindow, EqualsTheBatchWithNaNsAmongTheMeasurements) {
  LinearWindow w(5, 6);
  int bad = 0;
  for (int k = 0; k < 40; ++k) {
    w.move_to(100 * k + 100);
    for (auto& group : frame(w, k)) {
      if (k > 2 && w.any(4) == 0 && group[0].kind != Measured::Kind::level && group[0].kind != Measured::Kind::tie)
        group[0].bad = true, ++bad;
      w.give(std::move(group));
    }
    ASSERT_NE(w.window.update().status, Status::solve_failed);
    ASSERT_LT(k % 5 == 4 ? w.error() : 0.0, kExact) << "at update " << k;
  }
  EXPECT_GT(bad, 10);
  EXPECT_EQ(w.window.refusals()[0][Refusal::not_finite], bad);
}

class RejectSome final : public InsertionHook {
 public:
  int seen = 0, rejected = 0;
  std::string_view name() const override { return "reject some"; }
  Verdict inserted(const Graph&, const States&, const InsertedGroup&, GraphEdit&) override {
    if (++seen < 5 || seen % 3 != 0) return {};
    ++rejected;
    return {true, false, "every third"};
  }
};

// W9
TEST(LinearWindow, EqualsTheBatchWithoutTheGroupsThatAHookRejects) {
  LinearWindow w(6, 7);
  auto hook = std::make_unique<RejectSome>();
  const RejectSome& some = *hook;
  w.window.add(std::move(hook));
  for (int k = 0; k < 40; ++k) {
    w.move_to(100 * k + 100);
    for (auto& group : frame(w, k)) w.give(std::move(group));
    if (k > 3) w.give({w.level_at(100 * k - 150), w.position_at(100 * k - 130)});
    w.window.update();
    ASSERT_LT(k % 5 == 4 ? w.error() : 0.0, kExact) << "at update " << k;
  }
  EXPECT_GT(some.rejected, 20);
  EXPECT_EQ(w.window.refusals()[0][Refusal::rejected], some.rejected);
  EXPECT_STREQ(w.window.last_update().rejection[0] ? w.window.last_update().rejection : "every third", "every third");
}

}  // namespace
}  // namespace oriel
