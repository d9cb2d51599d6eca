// A deadline that passes at any moment of a solve. The clock is one that counts how often it is looked at, so that the
// moments are the same in every run: a stage is two looks (its begin and end), the question after it one more.
#include <gtest/gtest.h>

#include <cmath>

#include "linear/random_problem.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::RandomProblem;

// A landmark problem that takes several steps, some of them rejected.
class Problem : public RandomProblem {
 public:
  Problem() : RandomProblem(5) {
    curvature = 0.5;
    const auto x = variables<VectorNd<3>>(6);
    const auto m = variables<Markd<2>>(8);
    for (int i = 0; i < 60; ++i) factor<2>(any(x), any(m));
    for (const auto id : x) factor<3>(id);
    EXPECT_TRUE(apply());
  }
};

SolveOptions counted_options() {
  SolveOptions options;
  options.clock = [looks = 0.0]() mutable { return looks += 1.0; };
  options.max_iterations = 12;
  return options;
}

// The rest of a stage, its line of the trace, the question that finds the deadline passed, the hand-over of the values,
// the total. Two stages without a question between them take one look more.
constexpr double kLooksOfOneStage = 2 + 1 + 1 + 2 + 1;
constexpr double kLooksOfTheStart = 2 + 2 + 1;  // layout, first cost, first line of the trace

// The whole solve, in looks.
double whole() {
  Problem p;
  NativeEngine engine(p.graph);
  const Summary s = engine.solve(counted_options());
  EXPECT_GT(s.rejected, 0) << s;
  EXPECT_GT(s.accepted, 2) << s;
  return s.seconds.total;
}

TEST(Deadline, IsKeptToWithinOneStageWheneverItPasses) {  // L9
  const double end = whole();
  int stopped = 0;
  for (double deadline = kLooksOfTheStart; deadline < end; ++deadline) {
    Problem p;
    NativeEngine engine(p.graph);
    SolveOptions options = counted_options();
    options.deadline = Duration::from_seconds(deadline);
    const Summary s = engine.solve(options);
    EXPECT_LE(s.seconds.total, deadline + kLooksOfOneStage) << s;
    if (s.reason == Reason::deadline) {
      ++stopped;
      EXPECT_GT(s.reason_value, s.reason_bound);
      EXPECT_FALSE(s.converged() || s.failed());
    }
  }
  EXPECT_GE(stopped, end - kLooksOfTheStart - kLooksOfOneStage);
}

TEST(Deadline, LeavesTheBestValuesSoFarWhichAReplayOfItsIterationsFindsAgain) {  // L9, L10
  const double end = whole();
  for (double deadline = 1; deadline < end; ++deadline) {
    Problem p, replay;
    NativeEngine engine(p.graph), again(replay.graph);
    SolveOptions options = counted_options();
    options.deadline = Duration::from_seconds(deadline);
    const Summary s = engine.solve(options);
    double best = s.initial_cost;
    for (const IterationReport& r : s.trace) best = std::min(best, r.cost);
    EXPECT_EQ(s.final_cost, best);
    EXPECT_EQ(engine.cost(), s.final_cost);
    EXPECT_EQ(s.iterations, s.accepted + s.rejected) << s;
    const Summary r = again.solve({.max_iterations = s.iterations});
    EXPECT_EQ(fingerprint(replay.graph), fingerprint(p.graph)) << "deadline " << deadline << '\n' << s << r;
  }
}

TEST(Deadline, SaysWhatIsLeftToGainWhereALinearModelKnowsIt) {  // L9
  const double end = whole();
  int open = 0, taken = 0, none = 0;
  for (double deadline = 1; deadline < end; ++deadline) {
    Problem p;
    NativeEngine engine(p.graph);
    SolveOptions options = counted_options();
    options.deadline = Duration::from_seconds(deadline);
    const Summary s = engine.solve(options);
    if (s.reason != Reason::deadline) continue;
    if (!s.predicted_gain) {
      ++none;
      EXPECT_EQ(s.iterations, 0);
      EXPECT_NE(s.left_text().find("not known"), std::string::npos);
      continue;
    }
    ++(s.gain_open ? open : taken);
    EXPECT_GT(*s.predicted_gain, 0.0);
    EXPECT_EQ(s.left_text().find("not known") == std::string::npos, s.gain_open);
    EXPECT_TRUE(s.gain_open || s.trace.back().accepted) << s;
  }
  EXPECT_GT(open, 5);
  EXPECT_GT(taken, 5);
  EXPECT_GT(none, 2);
}

// On a linear problem the model is the truth, so what is left is exact.
TEST(Deadline, SaysExactlyWhatIsLeftOfALinearProblem) {  // L9
  RandomProblem p(8);
  p.curvature = 0.0;
  const auto x = p.variables<VectorNd<3>>(5);
  for (int i = 0; i < 30; ++i) p.factor<3>(p.any(x), p.any(x));
  for (const auto id : x) p.factor<3>(id);
  ASSERT_TRUE(p.apply());
  LinearStructure structure;
  ASSERT_TRUE(structure.build(p.graph, {}));
  const auto d = p.dense(structure);
  const double least = d.cost + 0.5 * d.g.dot(Eigen::VectorXd(d.h.ldlt().solve(-d.g)));
  NativeEngine engine(p.graph);
  bool seen = false;
  for (double deadline = kLooksOfTheStart; deadline < 40 && !seen; ++deadline) {
    SolveOptions options = counted_options();
    options.method = Method::gauss_newton;
    options.deadline = Duration::from_seconds(deadline);
    const Summary s = engine.solve(options);
    if (!s.gain_open || s.accepted > 0) continue;
    seen = true;
    EXPECT_NEAR(s.final_cost - *s.predicted_gain, least, 1e-10 * d.cost) << s;
  }
  EXPECT_TRUE(seen);
}

TEST(Deadline, DoesNotLookForWhatIsUndeterminedOnceItHasPassed) {  // L9, L6
  RandomProblem p(8);
  const auto x = p.variables<VectorNd<3>>(5);
  for (std::size_t i = 0; i + 1 < x.size(); ++i) p.factor<3>(x[i], x[i + 1]);
  p.variable<VectorNd<2>>();
  ASSERT_TRUE(p.apply());
  NativeEngine engine(p.graph);
  SolveOptions options = counted_options();
  EXPECT_FALSE(engine.solve(options).undetermined.empty());
  GraphEdit edit = p.graph.edit();
  for (const auto id : x) edit.set(id, VectorNd<3>{{{3.0, -2.0, 1.0}}});
  ASSERT_TRUE(p.graph.apply(edit));
  options = counted_options();
  options.deadline = Duration::from_seconds(18);
  const Summary s = engine.solve(options);
  ASSERT_EQ(s.reason, Reason::deadline) << s;
  ASSERT_TRUE(s.predicted_gain.has_value());
  EXPECT_TRUE(s.undetermined.empty());
}

}  // namespace
}  // namespace oriel
