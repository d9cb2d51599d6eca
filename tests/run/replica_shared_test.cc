// The replica on the public problems: sent the graph, then changes; its solves have the origin's bits.
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "oriel/graph/fingerprint.h"
#include "oriel/io/problem.h"
#include "oriel/run/registry.h"
#include "oriel/run/replica.h"

namespace oriel {
namespace {

const std::string kData = ORIEL_SHARED_DIR;

class Followed {
 public:
  explicit Followed(Replica& replica) : engine_(graph), replica_(replica), subscription_(graph.subscribe()) {}
  Graph graph;

  // Solved by one side with one thread and by the other with two, each having forgotten what it knew or not.
  void solve(int iterations) {
    ASSERT_TRUE(replica_.follow(graph, subscription_));
    if (random_() % 2) engine_.drop_caches();
    ASSERT_TRUE(random_() % 2 || replica_.drop_caches());
    SolveOptions options;
    options.max_iterations = iterations;
    options.threads = 1 + static_cast<int>(random_() % 2);
    const SolverState before = engine_.state();
    const Summary summary = engine_.solve(options);
    EXPECT_GT(summary.accepted, 0);
    SolveRequest request = request_of(options, before, summary);
    request.options.threads = 3 - options.threads;
    ASSERT_TRUE(replica_.solve(request));
    const auto got = replica_.outcome();
    ASSERT_TRUE(got) << got.error();
    EXPECT_EQ(got->final_cost, summary.final_cost);
    EXPECT_EQ(got->fingerprint, fingerprint(graph));
  }
  // Takes away one in `each` factors of the first table, and moves one in `each` of the variables.
  template <class V>
  void disturb(unsigned each) {
    GraphEdit edit = graph.edit();
    const FactorTable& table = *graph.tables()[0];
    for (std::uint32_t r = 0; r < table.extent(); ++r)
      if (table.slots().is_live(r) && random_() % each == 0)
        edit.remove(FactorId{table.ops().key, table.slots().key(r)});
    graph.for_each<V>([&](VariableId<V> id, const V& x) {
      Vec<double, V::kDim> d = Vec<double, V::kDim>::zero();
      d[0] = 0.01;
      if (random_() % each == 0) edit.set(id, x.plus(d));
    });
    const auto ok = graph.apply(edit);
    ASSERT_TRUE(ok) << ok.error();
  }

 private:
  NativeEngine engine_;
  Replica& replica_;
  Subscription subscription_;
  std::mt19937 random_{5};
};

// R1, L10
TEST(ReplicaOfRealProblems, HasTheSameBitsOnIntel) {
  auto replica = Replica::start(shipped_types());
  ASSERT_TRUE(replica) << replica.error();
  const auto file = read_g2o(kData + "/g2o/2d/intel.g2o");
  ASSERT_TRUE(file) << file.error();
  Followed followed(*replica);
  ASSERT_TRUE(add_pose_graph2(followed.graph, *file, {}));
  for (int round = 0; round < 6; ++round) {
    followed.solve(4);
    if (HasFailure()) FAIL() << "round " << round;
    followed.disturb<Pose2d>(50);
  }
}

// R1, L10
TEST(ReplicaOfRealProblems, HasTheSameBitsOnSphere2500) {
  auto replica = Replica::start(shipped_types());
  ASSERT_TRUE(replica) << replica.error();
  const auto file = read_g2o(kData + "/g2o/3d/sphere2500.g2o");
  ASSERT_TRUE(file) << file.error();
  Followed followed(*replica);
  PoseGraphOptions options;
  options.loss = Huber(2.0);
  ASSERT_TRUE(add_pose_graph3(followed.graph, *file, options));
  for (int round = 0; round < 4; ++round) {
    followed.solve(3);
    if (HasFailure()) FAIL() << "round " << round;
    followed.disturb<Pose3d>(100);
  }
}

// R1, L10
TEST(ReplicaOfRealProblems, HasTheSameBitsOnABundleAdjustment) {
  auto replica = Replica::start(shipped_types());
  ASSERT_TRUE(replica) << replica.error();
  const auto file = read_bal(kData + "/bal/problem-49-7776-pre.txt");
  ASSERT_TRUE(file) << file.error();
  Followed followed(*replica);
  ASSERT_TRUE(add_bundle_adjustment(followed.graph, *file, Loss::none()));
  for (int round = 0; round < 3; ++round) {
    followed.solve(3);
    if (HasFailure()) FAIL() << "round " << round;
    followed.disturb<Point3d>(200);
  }
}

}  // namespace
}  // namespace oriel
