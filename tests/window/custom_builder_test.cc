// A user's sensor: measurements are kept until the window drains them, as groups of factors.
#include <gtest/gtest.h>

#include <deque>

#include "rail.h"

namespace {

using namespace oriel;  // NOLINT(google-build-using-namespace): as a user would write it
using namespace oriel::rail;

// A post beside the rail, somewhere.
struct PostAhead {
  static constexpr std::string_view kName = "example.post_ahead/1";
  using Variables = Types<Along, VectorNd<1>>;
  double distance;  // [m]
  template <class S>
  S operator()(const VectorN<S, 1>& cart, const VectorN<S, 1>& post) const {
    return post.v[0] - cart.v[0] - distance;
  }
};

// A rangefinder that looks along the rail. The first range brings the post into the graph.
class RangeBuilder final : public FactorBuilder {
 public:
  explicit RangeBuilder(ProviderId cart) : cart_(cart) {}
  void add(Time time, double distance) { ranges_.push_back({time, distance}); }

  std::string_view name() const override { return "rangefinder"; }
  void drain(const Graph&, const States&, PendingFactors& pending) override {
    while (!ranges_.empty() && (has_post_ || bringing_ == 0)) {
      const auto [time, distance] = ranges_.front();
      ranges_.pop_front();
      const std::uint64_t number = pending.begin();
      if (!has_post_) bringing_ = number;
      const VariableId<Along> post = has_post_ ? post_ : pending.add(Along{});
      pending.add(PostAhead{distance}, Sigma(0.05), Huber(2.0), At<Along>{cart_, time}, post);
      pending.end();
    }
  }
  void entered(std::uint64_t group, std::span<const VariableKey> variables, std::span<const FactorId>) override {
    if (group != bringing_) return;
    post_ = VariableId<Along>{variables[0].key};
    has_post_ = true;
  }
  void refused(std::uint64_t group) override { bringing_ = group == bringing_ ? 0 : bringing_; }
  void reset() override { has_post_ = false, bringing_ = 0; }
  VariableId<Along> post() const { return post_; }

 private:
  struct Range {
    Time time;
    double distance;
  };
  ProviderId cart_;
  std::deque<Range> ranges_;
  VariableId<Along> post_;
  bool has_post_ = false;
  std::uint64_t bringing_ = 0;  // the group that brings the post
};

TEST(CustomBuilder, TurnsMeasurementsIntoFactorsOnStatesAndALandmark) {  // W6, W14
  Rail rail;
  auto owned = std::make_unique<RangeBuilder>(rail.wheel);
  RangeBuilder& ranges = *owned;
  rail.window.add(std::move(owned));
  rail.pass(0.0, at_s(0));
  for (int s = 0; s < 20; ++s) {
    ranges.add(at_s(s), 30.0 - s);
    ASSERT_EQ(rail.window.update().status, WindowUpdate::Status::updated);
  }
  EXPECT_NEAR(rail.window.graph().value(ranges.post()).v[0], 30.0, 1e-6);
  EXPECT_EQ(rail.window.last_update().entered, 1);
  ranges.add(at_s(0), 30.0);  // older than the window: refused, and counted under the builder's name
  const WindowUpdate& update = rail.window.update();
  const int sensor = rail.window.pending().sensor("rangefinder");
  EXPECT_EQ(update.refusals[sensor][Refusal::too_old], 1);
}

}  // namespace
