// A replica of a sliding stereo-inertial window: marginalized, with first estimates, over and over.
#include <gtest/gtest.h>

#include <random>

#include "oriel/graph/fingerprint.h"
#include "oriel/run/registry.h"
#include "oriel/run/replica.h"
#include "window/inertial_window.h"

namespace oriel {
namespace {

constexpr int kKeyframes = 60, kWindow = 10, kLandmarks = 150;

// A window and its replica; either side may have forgotten everything, and solves with one thread or two.
class FollowedWindow {
 public:
  explicit FollowedWindow(Replica& replica)
      : window_(kKeyframes, kLandmarks), engine_(window_.graph), replica_(replica), s_(window_.graph.subscribe()) {}

  void update() {
    window_.grow();
    ASSERT_TRUE(replica_.follow(window_.graph, s_));
    if (random_() % 3 == 0) engine_.drop_caches();
    ASSERT_TRUE(random_() % 3 > 0 || replica_.drop_caches());
    SolveOptions options;
    options.max_iterations = 4;
    options.threads = 1 + static_cast<int>(random_() % 2);
    const SolverState before = engine_.state();
    const Summary summary = engine_.solve(options);
    EXPECT_GT(summary.accepted, 0) << summary;
    SolveRequest request = request_of(options, before, summary);
    request.options.threads = 1 + static_cast<int>(random_() % 2);
    ASSERT_TRUE(replica_.solve(request));
    expect_equal();
    if (static_cast<int>(window_.states.size()) <= kWindow) return;
    window_.slide({}, marginalizer_);
    ASSERT_TRUE(replica_.follow(window_.graph, s_));
    ASSERT_TRUE(replica_.look());
    expect_equal();
  }
  std::size_t priors() const { return window_.graph.priors().slots().size(); }
  std::uint32_t first_estimates() const {
    return window_.graph.find_pool(kVariableOps<Pose3d>.key)->first_estimate_count();
  }

 private:
  void expect_equal() {
    const auto got = replica_.outcome();
    ASSERT_TRUE(got) << got.error();
    EXPECT_EQ(got->fingerprint, fingerprint(window_.graph)) << "keyframe " << window_.states.back().keyframe;
  }

  inertial_window::InertialWindow window_;
  NativeEngine engine_;
  Replica& replica_;
  Subscription s_;
  Marginalizer marginalizer_;
  std::mt19937 random_{3};
};

// R1, L10
TEST(ReplicaOfAWindow, HasTheSameBitsOverFiftySlides) {
  auto replica = Replica::start(shipped_types());
  ASSERT_TRUE(replica) << replica.error();
  FollowedWindow followed(*replica);
  for (int k = 1; k < kKeyframes; ++k) {
    followed.update();
    if (HasFailure()) FAIL() << "keyframe " << k;
  }
  EXPECT_EQ(followed.priors(), 1u);
  EXPECT_GT(followed.first_estimates(), 0u);
}

}  // namespace
}  // namespace oriel
