// Edits: ids before the thing exists, and what removal takes along.
#include <gtest/gtest.h>

#include <functional>

#include "graph/chain.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/manifold/vector.h"

namespace oriel {
namespace {

using testing::Chain;
using testing::pose_at;

TEST(GraphEdit, LendsIdsThatResolveInTheEditAtOnceAndInTheGraphAfterApply) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(pose_at(3.0), Label("x", 7));
  EXPECT_FALSE(graph.contains(x));
  EXPECT_EQ(graph.variable_count(), 0u);
  EXPECT_EQ(edit.value(x).translation()[0], 3.0);
  edit.set(x, pose_at(4.0));
  EXPECT_EQ(edit.value(x).translation()[0], 4.0);
  const std::uint64_t before = graph.version();
  ASSERT_TRUE(graph.apply(edit));
  EXPECT_GT(graph.version(), before);
  EXPECT_EQ(graph.value(x).translation()[0], 4.0);
  EXPECT_EQ(graph.describe(x), "pose3/1 'x7'");
  EXPECT_EQ(graph.apply(edit).error().code, ErrorCode::conflict);
  edit.clear();
  EXPECT_TRUE(edit.empty());
  EXPECT_TRUE(graph.apply(edit));
}

TEST(Graph, FailsLoudlyWithTheIdWhenAValueOfAStaleIdIsAskedFor) {  // V2
  Chain g;
  EXPECT_EQ(g.graph.find(g.gone), nullptr);
  EXPECT_FALSE(g.graph.contains(g.gone));
  EXPECT_FALSE(g.graph.contains(g.gone_factor));
  std::string id = "#";
  id.append(std::to_string(g.gone.key.index)).append(".").append(std::to_string(g.gone.key.generation));
  for (const auto& ask : std::vector<std::function<void()>>{[&] { static_cast<void>(g.graph.value(g.gone)); },
                                                            [&] { static_cast<void>(g.graph.edit().value(g.gone)); }}) {
    try {
      ask();
      ADD_FAILURE() << "a stale id gave a value";
    } catch (const ContractViolation& e) {
      EXPECT_NE(std::string(e.what()).find(id), std::string::npos) << e.what();
    }
  }
}

TEST(Graph, NeverResolvesAnErasedIdWhenItsSlotIsUsedAgain) {  // V1, V2
  Chain g;
  for (int i = 0; i < 50; ++i) {
    GraphEdit edit = g.graph.edit();
    const auto x = edit.add(pose_at(i));
    ASSERT_TRUE(g.graph.apply(edit));
    EXPECT_FALSE(g.graph.contains(g.gone));
    EXPECT_NE(x, g.gone);
    GraphEdit removal = g.graph.edit();
    removal.remove(x);
    ASSERT_TRUE(g.graph.apply(removal));
    EXPECT_EQ(g.graph.apply(removal).error().code, ErrorCode::conflict);
  }
  EXPECT_EQ(g.graph.variable_count(), 3u);
}

TEST(Graph, TakesEqualFactorsAsTwoAndSemidefiniteInformationAsItIs) {  // V5
  Chain g;
  const std::size_t before = g.graph.factor_count();
  GraphEdit edit = g.graph.edit();
  const auto first = edit.add(Prior{pose_at(2)}, Sigma(1), g.c), second = edit.add(Prior{pose_at(2)}, Sigma(1), g.c);
  Mat6d flat = Mat6d::zero();
  flat(3, 3) = 4.0;
  const auto third = edit.add(Prior{pose_at(2)}, Information(flat), g.c);
  ASSERT_TRUE(g.graph.apply(edit));
  EXPECT_NE(first, second);
  EXPECT_TRUE(g.graph.contains(first) && g.graph.contains(second) && g.graph.contains(third));
  EXPECT_EQ(g.graph.factor_count(), before + 3);
}

TEST(Noise, KeepsWeakDirectionsBesideStrongOnes) {  // V5
  // Information in [1/m², 1/rad²] may differ by 1e16: the weak one is no rounding error of the strong one.
  Mat2d information = Mat2d::identity();
  information(0, 0) = 1e16;
  const auto noise = Information(information);
  ASSERT_TRUE(noise.valid());
  EXPECT_EQ(noise.w[0], 1e8);
  EXPECT_EQ(noise.w[2], 1.0);
  Mat2d singular = Mat2d::constant(1e-9);  // rank one, far from 1 in scale
  const auto flat = Information(singular);
  ASSERT_TRUE(flat.valid());
  EXPECT_EQ(flat.w[2], 0.0);
  singular(1, 1) = 0.5e-9;  // now indefinite
  EXPECT_FALSE(Information(singular).valid());
}

// ---- removal ----

TEST(Graph, RemovesEveryFactorOfAVariableInTheSameEdit) {  // V6
  Chain g;
  GraphEdit edit = g.graph.edit();
  edit.remove(g.b);
  ASSERT_TRUE(g.graph.apply(edit));
  EXPECT_FALSE(g.graph.contains(g.between_ab) || g.graph.contains(g.between_bc) || g.graph.contains(g.linear_b));
  EXPECT_TRUE(g.graph.contains(g.prior_a));
  EXPECT_EQ(g.graph.factor_count(), 1u);
  int at_a = 0, at_c = 0;
  g.graph.for_each_factor(g.a, [&](auto, auto) { ++at_a; });
  g.graph.for_each_factor(g.c, [&](auto, auto) { ++at_c; });
  EXPECT_EQ(at_a, 1);
  EXPECT_EQ(at_c, 0);
}

TEST(Graph, LeavesTheEditOfItsUserAsItWasWhenAPriorLosesAVariable) {  // V6
  // A recording of the edit must say what the user said: the derived prior is the graph's own business.
  Chain g;
  GraphEdit edit = g.graph.edit();
  edit.remove(g.b);
  ASSERT_TRUE(g.graph.apply(edit));
  EXPECT_TRUE(edit.priors().empty());
}

TEST(Graph, MovesNothingWhenFixedIsSetToWhatItWas) {  // C6
  Chain g;
  const std::uint64_t structure = g.graph.structure_version();
  const Subscription s = g.graph.subscribe();
  GraphEdit net = g.graph.edit();
  g.graph.collect(s, net);
  GraphEdit edit = g.graph.edit();
  edit.fix(g.a, false);
  ASSERT_TRUE(g.graph.apply(edit));
  EXPECT_EQ(g.graph.structure_version(), structure);
  g.graph.collect(s, net);
  EXPECT_TRUE(net.empty());
  edit.clear();
  edit.fix(g.a, true);
  ASSERT_TRUE(g.graph.apply(edit));
  EXPECT_GT(g.graph.structure_version(), structure);
  EXPECT_TRUE(g.graph.fixed(g.a));
  g.graph.collect(s, net);
  EXPECT_FALSE(net.empty());
}

TEST(Graph, DoesNotMoveItsValuesAtEveryAddedVariable) {  // V1
  Graph graph;
  int moves = 0;
  const std::byte* at = nullptr;
  for (int i = 0; i < 5000; ++i) {
    GraphEdit edit = graph.edit();
    edit.add(pose_at(i));
    ASSERT_TRUE(graph.apply(edit));
    const std::byte* now = graph.pools()[0]->values();
    moves += now != at;
    at = now;
  }
  EXPECT_LE(moves, 20);
}

}  // namespace
}  // namespace oriel
