// Graduated non-convexity: it finds the line that most points lie on, however many are far off and whatever the start.
#include "oriel/solve/graduated.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "oriel/graph/fingerprint.h"
#include "oriel/manifold/vector.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

struct OnLine {
  static constexpr std::string_view kName = "test.on_line/1";
  using Variables = Types<VectorNd<2>>;
  double x = 0.0, y = 0.0;
  template <class S>
  S operator()(const VectorN<S, 2>& line) const {
    return line.v[0] * S(x) + line.v[1] - S(y);
  }
};

struct Fitting {
  Graph graph;
  VariableId<VectorNd<2>> line;
  std::vector<FactorId> bad;

  // y = 2 x - 1 with noise 0.1 (one whitened unit); every third point lies on another line.
  explicit Fitting(unsigned seed, const Loss& loss) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> at(-3.0, 3.0);
    GraphEdit edit = graph.edit();
    line = edit.add(VectorNd<2>{{-4.0, 9.0}});
    for (int i = 0; i < 90; ++i) {
      const double x = at(random), good = 2.0 * x - 1.0 + 0.1 * normal(random);
      const bool is_bad = i % 3 == 0;
      const FactorId id = edit.add(OnLine{x, is_bad ? 8.0 - 3.0 * x : good}, Sigma(0.1), loss, line);
      if (is_bad && std::fabs(8.0 - 3.0 * x - good) > 0.7) bad.push_back(id);
    }
    EXPECT_TRUE(graph.apply(edit));
  }
  double error() const { return (graph.value(line).v - Vec2d{2.0, -1.0}).norm(); }
};

// L8
TEST(Graduated, FindsTheLineOfTheMostPointsAndNamesTheOthers) {
  for (const Loss& loss : {TruncatedSquares(4.0), GemanMcClure(4.0)})
    for (unsigned seed = 1; seed <= 8; ++seed) {
      Fitting f(seed, loss);
      NativeEngine engine(f.graph);
      const auto report = solve_graduated(f.graph, engine);
      ASSERT_TRUE(report) << report.error();
      EXPECT_TRUE(report->summary.converged()) << report->summary;
      EXPECT_EQ(report->graduated, 90);
      EXPECT_GT(report->rounds, 3);
      EXPECT_LT(f.error(), 0.1) << name_of(loss.kind) << ", seed " << seed;
      for (const FactorId& id : f.bad)
        EXPECT_NE(std::find(report->outliers.begin(), report->outliers.end(), id), report->outliers.end());
      EXPECT_LE(report->outliers.size(), f.bad.size() + 3);
      EXPECT_NEAR(report->summary.final_cost, engine.cost(), 1e-12 * engine.cost());
    }
}

// L8: the loss alone stays in the minimum that is next to the start.
TEST(Graduated, GoesWhereTheLossAloneDoesNot) {
  Fitting alone(1, TruncatedSquares(4.0)), graduated(1, TruncatedSquares(4.0));
  (void)NativeEngine(alone.graph).solve();
  NativeEngine engine(graduated.graph);
  ASSERT_TRUE(solve_graduated(graduated.graph, engine));
  EXPECT_GT(alone.error(), 1.0);
  EXPECT_LT(graduated.error(), 0.1);
}

TEST(Graduated, LeavesTheLossesAndIdsAsTheyWere) {
  Fitting f(2, GemanMcClure(3.0));
  GraphEdit edit = f.graph.edit();
  const FactorId plain = edit.add(OnLine{0.0, -1.0}, Sigma(0.1), Huber(2.0), f.line);
  ASSERT_TRUE(f.graph.apply(edit));
  NativeEngine engine(f.graph);
  const auto report = solve_graduated(f.graph, engine);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->graduated, 90);  // Huber's has one minimum
  EXPECT_TRUE(f.graph.contains(plain));
  for (const FactorId& id : f.bad) EXPECT_TRUE(f.graph.contains(id));
  const FactorTable& table = *f.graph.tables()[0];
  for (std::uint32_t row = 0; row < table.extent(); ++row) {
    const bool is_plain = table.slots().key(row) == plain.key;
    EXPECT_EQ(table.loss(row).kind, is_plain ? LossKind::huber : LossKind::geman_mcclure);
    EXPECT_EQ(table.loss(row).scale, is_plain ? 2.0 : 3.0);
  }
}

TEST(Graduated, IsAPlainSolveWhereNoLossIsToBeGraduated) {
  Fitting a(3, Huber(1.0)), b(3, Huber(1.0));
  NativeEngine engine(a.graph);
  const auto report = solve_graduated(a.graph, engine);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->rounds, 1);
  EXPECT_EQ(report->graduated, 0);
  (void)NativeEngine(b.graph).solve();
  EXPECT_EQ(a.graph.value(a.line).v[0], b.graph.value(b.line).v[0]);
}

}  // namespace
}  // namespace oriel
