// What adopt may write, and what followers are told of values and flags.
#include <gtest/gtest.h>

#include <limits>

#include "oriel/graph/fingerprint.h"
#include "oriel/graph/graph.h"
#include "oriel/manifold/vector.h"

namespace oriel {
namespace {

using V1 = VectorNd<1>;

Solution solution_of(const Graph& graph, VariableId<V1> id, double value) {
  Solution s;
  s.version = graph.version();
  s.columns.push_back({&kVariableOps<V1>, {id.key}, ByteColumn(sizeof(V1))});
  const V1 v{{{value}}};
  s.columns[0].values.push_back(&v);
  return s;
}

TEST(Graph, NeverAdoptsOverANewerUserValueNorIntoFixedOrGoneVariables) {  // C5
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto moved = edit.add(V1{}), set = edit.add(V1{}), fixed = edit.add(V1{}), gone = edit.add(V1{});
  ASSERT_TRUE(graph.apply(edit));
  Solution s = solution_of(graph, moved, 1.0);
  const V1 one{{{1.0}}};
  for (const auto id : {set, fixed, gone}) s.columns[0].keys.push_back(id.key), s.columns[0].values.push_back(&one);
  GraphEdit between = graph.edit();
  between.set(set, V1{{{7.0}}});
  between.fix(fixed);
  between.remove(gone);
  ASSERT_TRUE(graph.apply(between));
  const Subscription follower = graph.subscribe();
  GraphEdit net = graph.edit();
  graph.collect(follower, net);
  ASSERT_TRUE(graph.adopt(s));
  EXPECT_EQ(graph.value(moved).v[0], 1.0);
  EXPECT_EQ(graph.value(set).v[0], 7.0);
  EXPECT_EQ(graph.value(fixed).v[0], 0.0);
  EXPECT_FALSE(graph.contains(gone));
  graph.collect(follower, net);
  EXPECT_TRUE(net.empty());  // no value flag is raised
}

TEST(Graph, NeverAdoptsIntoAWholeThatCameSince) {  // C5: its variables have the keys of those before
  Graph graph, another;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(V1{});
  ASSERT_TRUE(graph.apply(edit));
  const Solution s = solution_of(graph, x, 1.0);
  GraphEdit other = another.edit();
  ASSERT_EQ(other.add(V1{{{5.0}}}), x);
  ASSERT_TRUE(another.apply(other));
  const Subscription follower = another.subscribe();
  GraphEdit whole;
  another.collect(follower, whole);
  whole.mark_whole();
  ASSERT_TRUE(graph.apply(whole));
  ASSERT_TRUE(graph.adopt(s));
  EXPECT_EQ(graph.value(x).v[0], 5.0);
}

TEST(Graph, AdoptsNothingOfASolutionThatHoldsANan) {  // C5
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(V1{}), y = edit.add(V1{});
  ASSERT_TRUE(graph.apply(edit));
  Solution s = solution_of(graph, x, 1.0);
  const V1 bad{{{std::numeric_limits<double>::quiet_NaN()}}};
  s.columns[0].keys.push_back(y.key);
  s.columns[0].values.push_back(&bad);
  const std::uint64_t before = fingerprint(graph);
  EXPECT_EQ(graph.adopt(s).error().code, ErrorCode::not_finite);
  EXPECT_EQ(fingerprint(graph), before);
}

TEST(Graph, SendsWhatWasSetBeforeAFollowerHeardOfAVariableWithTheVariable) {  // C3
  Graph graph;
  const Subscription follower = graph.subscribe();
  GraphEdit net;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(V1{});
  ASSERT_TRUE(graph.apply(edit));
  GraphEdit set = graph.edit();
  set.set(x, V1{{{3.0}}});
  set.fix(x);
  ASSERT_TRUE(graph.apply(set));
  graph.collect(follower, net);
  const edit::Variables* c = net.find_variables(kVariableOps<V1>.key);
  ASSERT_NE(c, nullptr);
  ASSERT_EQ(c->added.size(), 1u);
  EXPECT_TRUE(c->added[0].fixed);
  EXPECT_TRUE(c->set.empty() && c->fixed.empty());
  GraphEdit later = graph.edit();
  later.set(x, V1{{{5.0}}});
  later.fix(x, false);
  ASSERT_TRUE(graph.apply(later));
  graph.collect(follower, net);
  c = net.find_variables(kVariableOps<V1>.key);
  EXPECT_TRUE(c->added.empty() && c->removed.empty());
  EXPECT_EQ(c->set.size(), 1u);
  EXPECT_EQ(c->fixed.size(), 1u);
}

}  // namespace
}  // namespace oriel
