// The layout of the linear problem is a function of the live graph, not of how the graph came to be.
#include "oriel/linear/structure.h"

#include <gtest/gtest.h>

#include <set>

#include "linear/random_problem.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::Mix;
using testing::RandomProblem;
using testing::System;

TEST(LinearStructure, NumbersEveryFreeScalarOnceAndNoFixedOne) {  // V1
  RandomProblem p(8);
  const auto x = p.variables<VectorNd<6>>(7);
  const auto y = p.variables<VectorNd<2>>(5);
  const auto m = p.variables<Markd<3>>(9);
  for (int i = 0; i < 40; ++i) p.factor<2>(p.any(x), p.any(m)), p.factor<2>(p.any(x), p.any(y));
  p.fix(x[2]), p.fix(m[4]), p.fix(y[0]);
  ASSERT_TRUE(p.apply());
  LinearStructure s;
  ASSERT_TRUE(s.build(p.graph, {}));
  EXPECT_EQ(s.dim(), 6 * 6 + 4 * 2 + 8 * 3);
  EXPECT_EQ(s.kept_dim(), 6 * 6 + 4 * 2);
  std::set<int> taken;
  const auto take = [&](VariableKey id, int dim) {
    const int at = p.offset(s, id);
    for (int k = 0; k < dim; ++k) {
      ASSERT_TRUE(taken.insert(at + k).second);
      std::uint32_t pool = 0, dense = 0;
      int within = 0;
      s.locate(at + k, pool, dense, within);
      EXPECT_EQ(within, k);
      EXPECT_EQ(p.graph.pools()[pool]->ops().key, id.type);
      EXPECT_EQ(p.graph.pools()[pool]->slots().key(dense), id.key);
    }
  };
  for (const auto id : x)
    if (id != x[2]) take(id, 6);
  for (const auto id : y)
    if (id != y[0]) take(id, 2);
  for (const auto id : m)
    if (id != m[4]) take(id, 3);
  EXPECT_EQ(p.offset(s, x[2]), -1);
  EXPECT_EQ(p.offset(s, m[4]), -1);
  EXPECT_EQ(p.offset(s, y[0]), -1);
  EXPECT_EQ(static_cast<int>(taken.size()), s.dim());
  EXPECT_EQ(*taken.rbegin(), s.dim() - 1);
}

// Three landmarks, two tables; `late` says which of the tables the graph met last.
std::vector<int> kept_landmarks(bool late) {
  using First = Mix<2, Markd<2>, Markd<3>>;
  using Second = Mix<3, Markd<3>, Markd<3>>;
  Graph graph;
  if (late) {  // the graph meets Second first, in an edit that leaves nothing behind
    GraphEdit edit = graph.edit();
    const auto a = edit.add(Markd<3>{});
    edit.add(Second{}, Sigma(1.0), a, a);
    EXPECT_TRUE(graph.apply(edit));
    GraphEdit removal = graph.edit();
    removal.remove(a);
    EXPECT_TRUE(graph.apply(removal));
  }
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Markd<2>{});
  const auto b = edit.add(Markd<3>{}), c = edit.add(Markd<3>{});
  edit.add(First{}, Sigma(1.0), a, b);
  edit.add(Second{}, Sigma(1.0), b, c);
  EXPECT_TRUE(graph.apply(edit));
  LinearStructure s;
  EXPECT_TRUE(s.build(graph, {}));
  std::vector<int> kept;
  for (const VariableKey id : {VariableKey(a), VariableKey(b), VariableKey(c)})
    for (std::size_t p = 0; p < graph.pools().size(); ++p)
      if (graph.pools()[p]->ops().key == id.type)
        kept.push_back(s.target(p, graph.pools()[p]->slots().find(id.key)).kind == Target::Kind::kept);
  return kept;
}

TEST(LinearStructure, EliminatesTheSameLandmarksInWhateverOrderTypesWereMet) {  // L10
  EXPECT_EQ(kept_landmarks(true), kept_landmarks(false));
}

TEST(LinearStructure, FollowsTheGraphThroughRandomEdits) {  // L2
  // One structure, rebuilt in place after each edit, against one that is new.
  RandomProblem p(13);
  std::vector<VariableId<VectorNd<3>>> x = p.variables<VectorNd<3>>(4);
  std::vector<VariableId<Markd<2>>> m = p.variables<Markd<2>>(4);
  ASSERT_TRUE(p.apply());
  LinearStructure reused;
  for (int round = 0; round < 40; ++round) {
    x.push_back(p.variable<VectorNd<3>>());
    m.push_back(p.variable<Markd<2>>());
    ASSERT_TRUE(p.apply());
    GraphEdit edit = p.graph.edit();
    using Seen = Mix<2, VectorNd<3>, Markd<2>>;
    for (int k = 0; k < 6; ++k) edit.add(Seen{p.normal(), 1.0, 0.0}, Sigma(1.0), p.any(x), p.any(m));
    edit.add(Between{VectorNd<3>{}}, Sigma(1.0), x[x.size() - 2], x.back());
    if (round % 3 == 1) {
      edit.remove(m.front());
      m.erase(m.begin());
    }
    if (round % 5 == 4) {
      edit.remove(x.front());
      x.erase(x.begin());
    }
    if (!p.graph.apply(edit)) edit.clear();  // it named something that it removes
    ASSERT_TRUE(reused.build(p.graph, {}));
    System fresh(p.graph);
    ASSERT_EQ(reused.dim(), fresh.structure.dim());
    LinearSystem numbers;
    fresh.linearizer.linearize(p.graph, reused, fresh.point, nullptr, numbers, nullptr);
    ASSERT_EQ(numbers.gradient, fresh.numbers.gradient);
    ASSERT_EQ(numbers.diagonal, fresh.numbers.diagonal);
    ASSERT_EQ(reused.landmark_pairs().size(), fresh.structure.landmark_pairs().size());
    for (std::size_t i = 0; i < reused.landmarks().size(); ++i)
      ASSERT_EQ(reused.landmarks()[i].data, fresh.structure.landmarks()[i].data);
  }
}

// L2: few landmarks among very many poses are left to the ordering; with as many as that they go first. The step is the
// same.
TEST(Structure, EliminatesLandmarksFirstUnlessTheyAreFewAmongMany) {
  for (const int marks : {40, 400}) {
    RandomProblem p(11);
    const auto x = p.variables<VectorNd<3>>(600);
    const auto m = p.variables<Markd<2>>(marks);
    for (std::size_t i = 0; i < x.size(); ++i) {
      p.factor<3>(x[i]);
      p.factor<2>(p.any(x), p.any(m));
      if (i > 0) p.factor<3>(x[i - 1], x[i]);
    }
    for (const auto& id : m) p.factor<2>(id);
    ASSERT_TRUE(p.apply());
    System system(p.graph);
    EXPECT_EQ(system.structure.landmarks().size(), marks == 40 ? 0u : 400u);
    const auto dense = p.dense(system.structure);
    const Eigen::VectorXd damping = Eigen::VectorXd::Constant(system.structure.dim(), 0.1),
                          expected = testing::dense_step(dense, damping);
    EXPECT_LE((system.solve(damping) - expected).norm(), 1e-9 * (1.0 + expected.norm()));
  }
}

}  // namespace
}  // namespace oriel
