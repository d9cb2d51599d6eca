// The elimination order of a large graph is state: who asks between solves, drops caches or restores gets the bits of
// who does not. A sync that is called is no question: it is a step, as a solve is.
#include <gtest/gtest.h>

#include "oriel/graph/fingerprint.h"
#include "oriel/manifold/se2.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

// A drive in laps of a hundred, long enough to be followed.
struct LargeDrive {
  Graph graph;
  std::vector<VariableId<Pose2d>> poses;
  void grow(int n) {
    GraphEdit edit = graph.edit();
    for (; n > 0; --n) {
      const std::size_t at = poses.size();
      const auto x =
          edit.add(Pose2d{}.plus({{0.01 * static_cast<double>(at % 7), 0.02 * static_cast<double>(at), 0.0}}));
      if (at == 0) edit.add(Prior{Pose2d{}}, Sigma(0.1), x);
      if (at > 0) edit.add(Between{Pose2d{}.plus({{0.0, 0.02, 0.0}})}, Sigma(0.1), poses.back(), x);
      if (at > 100 && at % 3 == 0) edit.add(Between{Pose2d{}.plus({{0.0, 2.0, 0.0}})}, Sigma(0.3), poses[at - 100], x);
      poses.push_back(x);
    }
    ASSERT_TRUE(graph.apply(edit));
  }
};

enum class Meanwhile { nothing, asks, drops_caches, restores, syncs, syncs_and_drops_caches };

std::vector<std::uint64_t> drive(Meanwhile what) {
  LargeDrive d;
  NativeEngine engine(d.graph);
  SolveOptions options;
  options.max_iterations = 2;
  std::vector<std::uint64_t> bits;
  d.grow(20100);
  for (int k = 0; k < 4; ++k) {
    EXPECT_FALSE(engine.solve(options).failed());
    bits.push_back(fingerprint(d.graph));
    const auto made = engine.state().order.made;
    EXPECT_EQ(made, 1u) << "the order was made anew where it need not";
    d.grow(100);
    if (what == Meanwhile::asks) {
      engine.cost();
      EXPECT_TRUE(engine.linearize(false));
    }
    if (what == Meanwhile::syncs || what == Meanwhile::syncs_and_drops_caches) {
      EXPECT_TRUE(engine.sync());
    }
    if (what == Meanwhile::syncs_and_drops_caches) engine.drop_caches();
    d.grow(50);
    if (what == Meanwhile::asks) engine.cost();
    if (what == Meanwhile::drops_caches) engine.drop_caches();
    if (what == Meanwhile::restores) {
      const SolverState state = engine.state();
      engine.restore({});
      engine.cost();
      engine.restore(state);
    }
  }
  return bits;
}

// L10
TEST(StateOrder, IsThatOfSolvesAloneWhateverIsAskedBetweenThem) {
  const auto bits = drive(Meanwhile::nothing);
  EXPECT_NE(bits.front(), bits.back());
  EXPECT_EQ(drive(Meanwhile::asks), bits);
  EXPECT_EQ(drive(Meanwhile::drops_caches), bits);
  EXPECT_EQ(drive(Meanwhile::restores), bits);
  EXPECT_EQ(drive(Meanwhile::syncs_and_drops_caches), drive(Meanwhile::syncs));
}

// Whoever syncs again and again without a solve pays for what changed.
TEST(StateOrder, GoesOnWithEachSync) {
  LargeDrive d;
  NativeEngine engine(d.graph);
  d.grow(20100);
  for (int k = 0; k < 5; ++k) {
    ASSERT_TRUE(engine.sync());
    EXPECT_EQ(engine.state().order.made, 1u);
    EXPECT_EQ(engine.state().order.serials.size(), d.poses.size());
    EXPECT_EQ(engine.structure().factorization().updates(), k);
    d.grow(100);
  }
}

}  // namespace
}  // namespace oriel
