// What an engine makes anew when its graph has changed, counted; and that what it kept changes no bit.
#include <gtest/gtest.h>

#include "oriel/graph/fingerprint.h"
#include "oriel/manifold/se2.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

Pose2d pose_at(double x, double angle = 0.0) { return Pose2d{}.plus(Vec3d{{angle, x, 0.1 * x}}); }

class SymbolicWork : public testing::Test {
 protected:
  SymbolicWork() : engine_(graph_) {
    GraphEdit edit = graph_.edit();
    for (int i = 0; i < 60; ++i) {
      poses_.push_back(edit.add(pose_at(i + 0.1 * (i % 7), 0.05 * (i % 5))));
      const std::size_t n = poses_.size();
      if (n > 1) last_ = edit.add(Between{pose_at(1.0)}, Sigma(0.1), Huber(1.0), poses_[n - 2], poses_[n - 1]);
      if (n > 20 && i % 3 == 0) edit.add(Between{pose_at(20.0, 0.01)}, Sigma(0.2), poses_[n - 21], poses_[n - 1]);
    }
    edit.add(Prior{pose_at(0.0)}, Sigma(0.1), poses_[0]);
    EXPECT_TRUE(graph_.apply(edit));
    solve();
  }

  // A few steps, by the engine that has followed and by one that knows nothing, from the same values.
  void solve() {
    GraphEdit whole;
    const Subscription s = graph_.subscribe();
    graph_.collect(s, whole);
    graph_.unsubscribe(s);
    Graph copy;
    ASSERT_TRUE(copy.apply(whole));
    NativeEngine fresh(copy);
    SolveOptions options;
    options.max_iterations = 3;
    EXPECT_FALSE(engine_.solve(options).failed());
    EXPECT_FALSE(fresh.solve(options).failed());
    EXPECT_EQ(fingerprint(copy), fingerprint(graph_));
  }
  std::uint64_t layouts() const { return engine_.structure().version(); }
  std::int64_t analyses() const { return engine_.structure().factorization().analyses(); }

  Graph graph_;
  std::vector<VariableId<Pose2d>> poses_;
  FactorId last_;
  NativeEngine engine_;
};

// C3
TEST_F(SymbolicWork, IsNotDoneForValuesThatWereSet) {
  const auto layouts_before = layouts();
  const auto analyses_before = analyses();
  for (int i = 0; i < 5; ++i) {
    GraphEdit edit = graph_.edit();
    edit.set(poses_[static_cast<std::size_t>(7 * i)], pose_at(3.0 * i));
    edit.fix(poses_[1], false);  // as it was
    ASSERT_TRUE(graph_.apply(edit));
    solve();
  }
  EXPECT_EQ(layouts(), layouts_before);
  EXPECT_EQ(analyses(), analyses_before);
}

TEST_F(SymbolicWork, IsOnlyTheLayoutOfRowsWhereTheSameVariablesAreTied) {
  const auto before = analyses();
  GraphEdit edit = graph_.edit();
  edit.set(last_, Cauchy(2.0));
  ASSERT_TRUE(graph_.apply(edit));
  solve();
  edit.clear();
  edit.add(Between{pose_at(0.9)}, Sigma(0.3), poses_[10], poses_[11]);  // tied already
  edit.add(Prior{pose_at(5.0)}, Sigma(0.5), poses_[5]);
  ASSERT_TRUE(graph_.apply(edit));
  solve();
  edit.clear();
  edit.remove(last_);
  last_ = edit.add(Between{pose_at(1.1)}, Sigma(0.1), poses_[58], poses_[59]);  // in place of it
  ASSERT_TRUE(graph_.apply(edit));
  solve();
  EXPECT_EQ(analyses(), before);
}

TEST_F(SymbolicWork, IsDoneOnceForEachChangeOfWhatIsTied) {
  const auto before = analyses();
  GraphEdit edit = graph_.edit();
  edit.add(Between{pose_at(30.0)}, Sigma(0.3), poses_[10], poses_[40]);
  ASSERT_TRUE(graph_.apply(edit));
  solve();
  EXPECT_EQ(analyses(), before + 1);
  solve();
  EXPECT_EQ(analyses(), before + 1);
  edit.clear();
  edit.fix(poses_[30]);
  ASSERT_TRUE(graph_.apply(edit));
  solve();
  EXPECT_EQ(analyses(), before + 2);
  edit.clear();
  edit.remove(poses_[59]);
  const auto last = edit.add(pose_at(59.0));
  edit.add(Between{pose_at(1.0)}, Sigma(0.1), poses_[58], last);
  ASSERT_TRUE(graph_.apply(edit));
  solve();
  EXPECT_EQ(analyses(), before + 2);  // another pose, tied as the one that went
  edit.clear();
  const auto next = edit.add(pose_at(60.0));
  edit.add(Between{pose_at(1.0)}, Sigma(0.1), last, next);
  ASSERT_TRUE(graph_.apply(edit));
  solve();
  EXPECT_EQ(analyses(), before + 3);
}

// A new value of the option is another order, also of the same pattern.
TEST_F(SymbolicWork, IsDoneAgainForAnotherOrdering) {
  const auto before = analyses();
  SolveOptions options;
  options.ordering = OrderingMethod::nested_dissection;
  EXPECT_FALSE(engine_.solve(options).failed());
  EXPECT_EQ(analyses(), before + 1);
}

}  // namespace
}  // namespace oriel
