// Hooks are asked about groups that come after their states have left, before these go into the prior.
#include <gtest/gtest.h>

#include "linear_window.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/window/late_fusion.h"
#include "oriel/window/mahalanobis_gate.h"

namespace oriel {
namespace {

using namespace linear_world;
using Status = WindowUpdate::Status;

// A window of some states, and a gate with covariance for its second sensor.
struct GatedWindow : LinearWindow {
  LateFusion* late = nullptr;
  MahalanobisGate* gate = nullptr;
  int gnss = 0;

  explicit GatedWindow(int most_states, bool with_covariance = true, bool rejects = true)
      : LinearWindow(most_states, 21) {
    builder->sensors = {"linear", "gnss"};
    gnss = window.pending().sensor("gnss");
    auto fusion = std::make_unique<LateFusion>();
    late = fusion.get();
    window.set(std::move(fusion));
    window.remember(Duration::from_seconds(100.0));
    auto hook = std::make_unique<MahalanobisGate>(window.core().followed());
    gate = hook.get();
    EXPECT_TRUE(
        gate->set(gnss, {.probability = 0.999, .with_covariance = with_covariance, .rejects_group = rejects}).ok());
    window.add(std::move(hook));
  }
  void drive(int frames) {
    for (int k = 0; k < frames; ++k) {
      move_to(100 * k + 100);
      give({position_at(100 * k), sight(100 * k, k / 5)});
      if (k > 3) give({step(100 * (k - 3), 100 * k)});
      ASSERT_EQ(window.update().status, Status::updated);
    }
  }
  Measured fix(std::int64_t ms, double x, double y, double sigma = 0.3) {
    Measured m = position_at(ms);
    m.z = {x, y, 0.0}, m.sigma = sigma, m.sensor = 1;
    return m;
  }
};

struct Asked final : InsertionHook {
  bool reject = false;
  int inserted_groups = 0;
  std::vector<LateArrival> all;
  std::size_t priors = 0, columns = 0;
  std::string_view name() const override { return "asked"; }
  Verdict inserted(const Graph&, const States&, const InsertedGroup&, GraphEdit&) override {
    ++inserted_groups;
    return {};
  }
  Verdict late(const Graph& graph, const States&, const LateArrival& arrival) override {
    all.push_back(arrival);
    priors = arrival.edit.priors().added.size();
    for (const VariableKey id : arrival.edit.priors().variables) EXPECT_NE(graph.find_value(id), nullptr);
    return {reject, true, "not that late"};
  }
};

// W7, W9
TEST(LateHooks, AreAskedOncePerGroupAndOfARejectedOneNothingIsLeft) {
  GatedWindow w(4);
  w.drive(12);
  auto owned = std::make_unique<Asked>();
  Asked& hook = *owned;
  w.window.add(std::move(owned));
  hook.reject = true;
  const std::uint64_t before = fingerprint(w.window.graph());
  const std::size_t kept = w.late->kept().size();
  for (const std::int64_t ms : {300, 333}) {        // a time that had a state, and one that never had
    w.give({w.position_at(ms), w.step(ms, 1150)});  // and one that is new, in the window
    const WindowUpdate& update = w.window.update();
    EXPECT_EQ(update.refusals[0][Refusal::rejected], 1);
    EXPECT_STREQ(update.rejection, "not that late");
    EXPECT_STREQ(update.reset, "");
    EXPECT_EQ(update.late, 0);
    EXPECT_EQ(fingerprint(w.window.graph()), before);
    EXPECT_EQ(w.late->kept().size(), kept);
    ASSERT_EQ(hook.all.size(), ms == 300 ? 1u : 2u);
    EXPECT_EQ(hook.all.back().sensor, 0);
    EXPECT_EQ(hook.all.back().oldest, at_ms(ms));
    EXPECT_EQ(hook.all.back().newest, at_ms(1150));
    EXPECT_EQ(hook.priors, 2u);
  }
  EXPECT_EQ(hook.inserted_groups, 0);
  EXPECT_EQ(w.builder->refusals, 2);
  hook.reject = false;
  w.give({w.position_at(333), w.step(333, 1150)});
  EXPECT_EQ(w.window.update().late, 1);
  EXPECT_EQ(w.late->states_made(), 1);
  EXPECT_LT(w.error(), 1e-9);
}

// W7, W9: d² is that of a window in which nothing has left.
TEST(LateHooks, TheGateMeasuresALateFactorAsIfItHadComeInTime) {
  for (const std::int64_t ms : {300, 333, 590}) {
    GatedWindow few(4), all(100);
    few.drive(12), all.drive(12);
    // Where in time a state comes between two, it stands where the older one predicts it until it is solved for.
    all.window.pending().begin(0);
    all.window.pending().need(At<Position>{all.positions, at_ms(ms)});
    all.window.pending().end();
    all.window.update();
    for (GatedWindow* w : {&few, &all}) {
      w->give({w->fix(ms, 1.5, -0.7)});
      ASSERT_EQ(w->window.update().refused + w->window.last_update().late + w->window.last_update().entered, 1);
    }
    EXPECT_EQ(all.window.last_update().late, 0);
    EXPECT_GT(all.gate->last_distance(), 0.01);
    EXPECT_NEAR(few.gate->last_distance(), all.gate->last_distance(), 1e-7 * all.gate->last_distance()) << ms;
  }
}

// W7, W9
TEST(LateHooks, TheGateKeepsGrossErrorsOutOfThePriorAndLetsTheRestIn) {
  for (const bool with_covariance : {false, true}) {
    GatedWindow w(4, with_covariance);
    w.drive(12);
    const auto truth = w.truth().solve();
    const Eigen::VectorXd x = truth.at({What::position, at_ms(300).ns});
    const std::uint64_t before = fingerprint(w.window.graph());
    w.give({w.fix(300, x[0] + 50.0, x[1])});
    w.give({w.fix(300, x[0], x[1]), w.fix(1100, 500.0, x[1])});  // one of two, which is not late
    const WindowUpdate& refused = w.window.update();
    EXPECT_EQ(refused.refusals[static_cast<std::size_t>(w.gnss)][Refusal::rejected], 2);
    EXPECT_EQ(w.gate->rejected(), 2);
    EXPECT_EQ(fingerprint(w.window.graph()), before);
    w.give({w.fix(300, x[0] + 0.1, x[1])});
    Measured other = w.position_at(200);  // of a sensor that has no gate
    other.z = {80.0, 0.0, 0.0};
    w.give({other});
    EXPECT_EQ(w.window.update().late, 2);
    EXPECT_LT(w.error(), 1e-8);
  }
}

}  // namespace
}  // namespace oriel
