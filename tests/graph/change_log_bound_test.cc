// What the log keeps is bounded, and who falls too far behind takes the whole graph.
#include <gtest/gtest.h>

#include "graph/random_graph.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/graph/wire.h"

namespace oriel {
namespace {

using testing_graph::random_graph_types;
using testing_graph::RandomGraph;

struct Follower {
  explicit Follower(Graph& followed) : origin(followed), subscription(followed.subscribe()) {}
  void look() {
    origin.collect(subscription, edit);
    const auto ok = graph.apply(edit);
    ASSERT_TRUE(ok) << ok.error();
  }
  bool behind() const { return origin.log().behind(subscription); }

  Graph& origin;
  Subscription subscription;
  Graph graph;
  GraphEdit edit;
};

std::vector<VariableId<Point3d>> add_points(Graph& graph, int n) {
  GraphEdit edit = graph.edit();
  std::vector<VariableId<Point3d>> ids;
  for (int i = 0; i < n; ++i) ids.push_back(edit.add(Point3d{{{1.0 * i, 0, 0}}}));
  EXPECT_TRUE(graph.apply(edit));
  return ids;
}

// C1
TEST(ChangeLogBound, GivesTheWholeGraphToAFollowerWhoseChangesWouldBeMore) {
  Graph graph;
  graph.bound_log({.per_live = 0.5, .least = 4});
  const auto ids = add_points(graph, 20);
  Follower often(graph), seldom(graph);
  often.look();
  seldom.look();
  for (int i = 0; i < 20; ++i) {
    GraphEdit edit = graph.edit();
    edit.set(ids[static_cast<std::size_t>(i)], Point3d{{{0, 1.0 * i, 0}}});
    ASSERT_TRUE(graph.apply(edit));
    often.look();
    EXPECT_FALSE(often.edit.whole());
    EXPECT_LE(graph.log().entries(), 2u * 2u * 10u);
  }
  EXPECT_TRUE(seldom.behind());
  EXPECT_FALSE(often.behind());
  EXPECT_EQ(graph.log().left_behind(), 1u);
  EXPECT_EQ(fingerprint(often.graph), fingerprint(graph));
  EXPECT_NE(fingerprint(seldom.graph), fingerprint(graph));

  seldom.look();
  EXPECT_TRUE(seldom.edit.whole());
  EXPECT_EQ(fingerprint(seldom.graph), fingerprint(graph));
  GraphEdit edit = graph.edit();
  edit.remove(ids[3]);
  ASSERT_TRUE(graph.apply(edit));
  seldom.look();
  EXPECT_FALSE(seldom.edit.whole());  // in step again
  EXPECT_EQ(seldom.edit.find_variables(kVariableOps<Point3d>.key)->removed.size(), 1u);
  EXPECT_EQ(fingerprint(seldom.graph), fingerprint(graph));
}

// C1
TEST(ChangeLogBound, KeepsTheLatestOfWhatChangesAgainAndAgain) {
  Graph graph;
  graph.bound_log({.per_live = 1.0, .least = 16});
  GraphEdit first = graph.edit();
  const auto a = first.add(Pose3d{});
  const auto b = first.add(Pose3d{});
  const FactorId one = first.add(Prior{Pose3d{}}, Sigma(1.0), Huber(1.0), a);
  const FactorId other = first.add(Prior{Pose3d{}}, Sigma(1.0), Huber(1.0), b);
  ASSERT_TRUE(graph.apply(first));
  Follower follower(graph);
  follower.look();
  std::size_t most = 0;
  for (int i = 0; i < 5000; ++i) {
    GraphEdit edit = graph.edit();
    edit.set(one, Huber(1.0 + i));
    if (i == 17) edit.set(other, Cauchy(3.0));
    if (i % 3 == 0) edit.set(a, Pose3d{}.plus(Vec6d{{0, 0, 0, 1.0 * i, 0, 0}}));
    if (i % 5 == 0) edit.fix(b, i % 2 == 0);
    ASSERT_TRUE(graph.apply(edit));
    most = std::max(most, graph.log().entries());
  }
  EXPECT_LE(most, 32u);
  EXPECT_FALSE(follower.behind());  // four things are new to it, however often they changed
  follower.look();
  EXPECT_FALSE(follower.edit.whole());
  EXPECT_EQ(fingerprint(follower.graph), fingerprint(graph));
  EXPECT_EQ(follower.graph.tables()[0]->loss(0).scale, 5000.0);
  EXPECT_EQ(follower.graph.tables()[0]->loss(1).kind, LossKind::cauchy);
  EXPECT_EQ(graph.log().entries(), 0u);
}

// C2
TEST(ChangeLogBound, KeepsNothingOfWhatNoFollowerHasHeardOf) {
  Graph graph;
  const auto kept = add_points(graph, 1);
  Follower never(graph), early(graph);
  early.look();
  for (int i = 0; i < 5000; ++i) {
    const auto ids = add_points(graph, 2);
    GraphEdit edit = graph.edit();
    edit.set(ids[0], Point3d{{{1, 2, 3}}});
    edit.fix(ids[0]);
    ASSERT_TRUE(graph.apply(edit));
    edit.clear();
    edit.remove(ids[0]);
    edit.remove(ids[1]);
    ASSERT_TRUE(graph.apply(edit));
    ASSERT_EQ(graph.log().entries(), 0u);
  }
  EXPECT_FALSE(early.behind());
  early.look();
  EXPECT_TRUE(early.edit.empty());
  never.look();
  EXPECT_FALSE(never.edit.whole());  // it has nothing to forget
  EXPECT_EQ(fingerprint(never.graph), fingerprint(graph));
}

// C1
TEST(ChangeLogBound, LetsAFollowerGoThatHasSeenAGraphWhichIsNoMore) {
  Graph graph;
  graph.bound_log({.per_live = 1.0, .least = 16});
  const auto ids = add_points(graph, 300);
  Follower follower(graph);
  follower.look();
  for (std::size_t i = 0; i < 290; ++i) {
    GraphEdit edit = graph.edit();
    edit.remove(ids[i]);
    ASSERT_TRUE(graph.apply(edit));
    EXPECT_LE(graph.log().entries(), 2 * graph.log().bound().entries(graph.variable_count()));
  }
  EXPECT_TRUE(follower.behind());
  follower.look();
  EXPECT_EQ(fingerprint(follower.graph), fingerprint(graph));
}

TEST(ChangeLogBound, TellsTheFollowersOfAFollowerThatWasGivenTheWhole) {
  RandomGraph origin(5);
  origin.graph.bound_log({.per_live = 0.1, .least = 2});
  Follower middle(origin.graph);
  Follower last(middle.graph);
  bool whole = false;
  for (int round = 0; round < 60; ++round) {
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(origin.step(6));
    const std::uint64_t version = middle.graph.version();
    middle.look();
    EXPECT_GT(middle.graph.version(), version);  // also of one that began anew
    last.look();
    EXPECT_EQ(middle.edit.whole(), last.edit.whole() && round > 0) << round;
    whole = whole || middle.edit.whole();
    ASSERT_EQ(fingerprint(middle.graph), fingerprint(origin.graph)) << round;
    ASSERT_EQ(fingerprint(last.graph), fingerprint(origin.graph)) << round;
  }
  EXPECT_TRUE(whole);
}

TEST(ChangeLogBound, SendsTheWholeAsAMessageOfItsOwn) {
  RandomGraph origin(6);
  origin.graph.bound_log({.per_live = 0.0, .least = 0});
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(origin.step(6));
  const Subscription s = origin.graph.subscribe();
  Graph follower;
  GraphEdit net, read;
  int whole = 0;
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(origin.step(6));
    origin.graph.collect(s, net);
    Bytes bytes;
    append_edit(bytes, net);
    const auto message = read_message(bytes);
    ASSERT_TRUE(message) << message.error();
    EXPECT_EQ(message->kind, net.whole() ? kWholeMessage : kEditMessage);
    whole += net.whole();
    const auto ok = read_edit(*message, random_graph_types(), follower, read);
    ASSERT_TRUE(ok) << ok.error();
    ASSERT_TRUE(follower.apply(read));
    ASSERT_EQ(fingerprint(follower), fingerprint(origin.graph)) << i;
  }
  EXPECT_GT(whole, 5);
}

TEST(ChangeLogBound, LeavesAGraphAsItWasThatRefusesAWhole) {
  RandomGraph origin(7);
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(origin.step(6));
  Graph other;
  const auto ids = add_points(other, 3);
  GraphEdit edit;
  other.collect(other.subscribe(), edit);
  edit.mark_whole();
  double* value = reinterpret_cast<double*>(edit.variables(&kVariableOps<Point3d>).values.data());
  value[4] = std::nan("");
  const std::uint64_t before = fingerprint(origin.graph), version = origin.graph.version();
  const auto refused = origin.graph.apply(edit);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::not_finite);
  EXPECT_EQ(fingerprint(origin.graph), before);
  EXPECT_EQ(origin.graph.version(), version);
  value[4] = 0.0;
  ASSERT_TRUE(origin.graph.apply(edit));
  EXPECT_EQ(fingerprint(origin.graph), fingerprint(other));
  EXPECT_GT(origin.graph.structure_version(), version);
  EXPECT_TRUE(origin.graph.contains(ids[2]));
}

}  // namespace
}  // namespace oriel
