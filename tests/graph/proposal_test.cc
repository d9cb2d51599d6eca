// Edits with placeholder ids, made by workers that must not lend: the origin's apply gives the true ids (decision 8).
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <span>

#include "graph/chain.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/graph/wire.h"

namespace oriel {
namespace {

using testing::Chain;
using testing::pose_at;
using testing::unit_prior;

TypeList types() {
  TypeList list;
  list.factor<Prior<Pose3d>, IsotropicNoise>().factor<Between<Pose3d>, IsotropicNoise>();
  return list;
}

// A copy of the origin that follows it.
struct Replica {
  explicit Replica(Graph& followed) : origin(followed), subscription(followed.subscribe()) { look(); }
  void look() {
    GraphEdit net;
    origin.collect(subscription, net);
    for (const auto& c : net.variable_columns())
      for (const auto& a : c->added) EXPECT_FALSE(is_placeholder(a.key));
    for (const auto& c : net.factor_columns()) {
      for (const auto& a : c->added) EXPECT_FALSE(is_placeholder(a.key));
      for (const SlotKey k : c->variables) EXPECT_FALSE(is_placeholder(k));
    }
    const auto ok = graph.apply(net);
    ASSERT_TRUE(ok) << ok.error();
  }
  Graph& origin;
  Subscription subscription;
  Graph graph;
};

// A pose that hangs on c, with everything that an edit may say of it.
struct Addition {
  VariableId<Pose3d> pose, last;
  FactorId between, linear;

  Addition(GraphEdit& edit, const Chain& g) {
    pose = edit.add(pose_at(3.0), Label("new"));
    last = edit.add(edit.value(pose) * pose_at(1.0));
    between = edit.add(Between{pose_at(1.0)}, Sigma(0.1), g.c, pose);
    edit.add(Between{pose_at(1.0)}, Sigma(0.2), Huber(1.0), pose, last);
    linear = edit.add(unit_prior(last, pose_at(4.0)));
    edit.set(pose, pose_at(3.25));
    edit.set(g.b, pose_at(1.25));
    edit.fix(last);
    edit.remove(g.prior_a);
  }
};

void expect_addition(const Graph& graph, const GraphEdit& applied, const Addition& placed, const Chain& g) {
  const auto pose = applied.resolved(placed.pose), last = applied.resolved(placed.last);
  ASSERT_TRUE(graph.contains(pose) && graph.contains(last));
  EXPECT_FALSE(is_placeholder(pose.key) || is_placeholder(last.key));
  EXPECT_EQ(graph.value(pose).minus(pose_at(3.25)).norm(), 0.0);
  EXPECT_EQ(graph.value(last).minus(pose_at(4.0)).norm(), 0.0);
  EXPECT_TRUE(graph.fixed(last));
  EXPECT_FALSE(graph.fixed(pose));
  EXPECT_EQ(graph.describe(pose), "pose3/1 'new'");
  EXPECT_TRUE(graph.contains(applied.resolved(placed.between)));
  EXPECT_TRUE(graph.contains(applied.resolved(placed.linear)));
  EXPECT_FALSE(graph.contains(g.prior_a));
  std::size_t at_pose = 0, at_last = 0;
  graph.for_each_factor(pose, [&](auto, auto) { ++at_pose; });
  graph.for_each_factor(last, [&](auto, auto) { ++at_last; });
  EXPECT_EQ(at_pose, 2u);
  EXPECT_EQ(at_last, 2u);
}

TEST(Proposal, IsGivenIdsByTheOriginWhateverItLentMeanwhile) {
  Chain g;
  Replica worker(g.graph), follower(g.graph);
  GraphEdit proposal = GraphEdit::proposal(&worker.graph);
  const Addition placed(proposal, g);
  EXPECT_EQ(proposal.value(placed.pose).minus(pose_at(3.25)).norm(), 0.0);
  EXPECT_EQ(proposal.value(g.c).minus(pose_at(2.0)).norm(), 0.0);  // what the worker knows
  EXPECT_EQ(proposal.resolved(placed.pose), placed.pose);          // not yet
  GraphEdit meanwhile = g.graph.edit();
  const auto other = meanwhile.add(pose_at(8.0));
  ASSERT_TRUE(g.graph.apply(meanwhile));
  Bytes bytes;
  append_edit(bytes, proposal);
  GraphEdit arrived;
  ASSERT_TRUE(read_edit(*read_message(bytes), types(), g.graph, arrived));
  const auto ok = g.graph.apply(arrived);
  ASSERT_TRUE(ok) << ok.error();
  expect_addition(g.graph, arrived, placed, g);
  EXPECT_NE(arrived.resolved(placed.pose), other);
  follower.look();
  worker.look();
  EXPECT_EQ(fingerprint(follower.graph), fingerprint(g.graph));
  EXPECT_EQ(fingerprint(worker.graph), fingerprint(g.graph));
  EXPECT_TRUE(worker.graph.contains(arrived.resolved(placed.last)));
}

TEST(Proposal, MakesTheSameGraphAsAnEditThatTheOriginLent) {
  Chain one, other;
  GraphEdit lent = one.graph.edit(), proposal = GraphEdit::proposal(&other.graph);
  const Addition a(lent, one), b(proposal, other);
  ASSERT_TRUE(one.graph.apply(lent));
  ASSERT_TRUE(other.graph.apply(proposal));
  EXPECT_EQ(fingerprint(one.graph), fingerprint(other.graph));
  EXPECT_EQ(proposal.resolved(b.pose), a.pose);
  EXPECT_EQ(lent.resolved(a.pose), a.pose);
}

// The next id that the graph would lend comes with the edit, beside a placeholder.
TEST(Proposal, IsNotGivenAnIdThatTheSameEditBrings) {
  Chain g;
  GraphEdit edit = GraphEdit::proposal(&g.graph);
  const auto placed = edit.add(pose_at(5.0));
  const SlotKey next{g.gone.key.index, g.gone.key.generation + 1};
  const Pose3d value = pose_at(6.0);
  edit.variables(&kVariableOps<Pose3d>).add({next, 0, 100, false, false}, &value, &value);
  const auto ok = g.graph.apply(edit);
  ASSERT_TRUE(ok) << ok.error();
  const auto given = edit.resolved(placed);
  EXPECT_FALSE(given.key == next);
  EXPECT_EQ(g.graph.value(given).translation()[0], pose_at(5.0).translation()[0]);
  EXPECT_EQ(g.graph.value(VariableId<Pose3d>{next}).translation()[0], value.translation()[0]);
}

TEST(Proposal, OfTwoWorkersWithTheSamePlaceholdersBecomesTwoThings) {
  Chain g;
  GraphEdit first = GraphEdit::proposal(&g.graph), second = GraphEdit::proposal(&g.graph);
  const auto a = first.add(pose_at(5.0)), b = second.add(pose_at(6.0));
  const FactorId fa = first.add(Prior{pose_at(5.0)}, Sigma(0.1), a),
                 fb = second.add(Prior{pose_at(6.0)}, Sigma(0.1), b);
  EXPECT_EQ(a, b);
  ASSERT_TRUE(g.graph.apply(first));
  ASSERT_TRUE(g.graph.apply(second));
  EXPECT_NE(first.resolved(a), second.resolved(b));
  EXPECT_NE(first.resolved(fa), second.resolved(fb));
  EXPECT_EQ(g.graph.value(first.resolved(a)).minus(pose_at(5.0)).norm(), 0.0);
  EXPECT_EQ(g.graph.value(second.resolved(b)).minus(pose_at(6.0)).norm(), 0.0);
  // The storage is used again: placeholders begin anew.
  first.clear();
  EXPECT_EQ(first.add(pose_at(7.0)), a);
  ASSERT_TRUE(g.graph.apply(first));
  EXPECT_EQ(g.graph.value(first.resolved(a)).minus(pose_at(7.0)).norm(), 0.0);
}

TEST(Proposal, CanBeMadeWithoutAnyGraph) {
  GraphEdit proposal = GraphEdit::proposal();
  const auto a = proposal.add(pose_at(1.0)), b = proposal.add(pose_at(2.0));
  proposal.add(Between{pose_at(1.0)}, Sigma(0.1), a, b);
  proposal.add(unit_prior(a, pose_at(1.0)));
  proposal.fix(a);
  Graph graph;
  const auto ok = graph.apply(proposal);
  ASSERT_TRUE(ok) << ok.error();
  EXPECT_EQ(graph.variable_count(), 2u);
  EXPECT_EQ(graph.factor_count(), 2u);
  EXPECT_TRUE(graph.fixed(proposal.resolved(a)));
}

// V5
TEST(Proposal, ThatIsRefusedLeavesTheGraphBitIdenticalAndKeepsItsPlaceholders) {
  Chain g;
  const std::uint64_t before = fingerprint(g.graph), version = g.graph.version();
  GraphEdit proposal = GraphEdit::proposal(&g.graph);
  const Addition placed(proposal, g);
  proposal.require_version(version + 1);
  const auto refused = g.graph.apply(proposal);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::conflict);
  EXPECT_EQ(fingerprint(g.graph), before);
  EXPECT_EQ(g.graph.version(), version);
  EXPECT_EQ(proposal.resolved(placed.pose), placed.pose);
  proposal.require_version(version);
  ASSERT_TRUE(g.graph.apply(proposal));
  expect_addition(g.graph, proposal, placed, g);
}

// V5
TEST(Proposal, WithPlaceholdersThatStandForNothingIsRefusedByName) {
  using Edit = GraphEdit;
  const auto bad = VariableId<Pose3d>{placeholder_key(7)};
  const std::vector<std::pair<ErrorCode, std::function<void(Chain&, Edit&)>>> spoils = {
      {ErrorCode::stale_id, [&](Chain&, Edit& e) { e.add(Prior{pose_at(1)}, Sigma(1.0), bad); }},
      {ErrorCode::stale_id, [&](Chain&, Edit& e) { e.set(bad, pose_at(1)); }},
      {ErrorCode::stale_id, [&](Chain&, Edit& e) { e.fix(bad); }},
      {ErrorCode::stale_id, [&](Chain&, Edit& e) { e.remove(bad); }},
      {ErrorCode::stale_id, [&](Chain&, Edit& e) { e.remove(e.add(pose_at(1))); }},  // what it adds itself
      {ErrorCode::stale_id, [&](Chain& g, Edit& e) { e.remove(e.add(Prior{pose_at(1)}, Sigma(1.0), g.a)); }},
      {ErrorCode::stale_id, [&](Chain&, Edit& e) { e.add(unit_prior(bad, pose_at(1))); }},
      {ErrorCode::stale_id, [](Chain& g, Edit& e) { e.add(Prior{pose_at(1)}, Sigma(1.0), g.gone); }},
      {ErrorCode::not_finite, [](Chain&, Edit& e) { e.add(pose_at(std::nan(""))); }},
      {ErrorCode::duplicate,
       [](Chain&, Edit& e) {  // a damaged message: the second thing says that it is the first
         e.add(pose_at(1));
         const Pose3d x = pose_at(2);
         e.variables(&kVariableOps<Pose3d>).add({placeholder_key(0), 0, e.next_order(), false, false}, &x, &x);
       }},
      {ErrorCode::duplicate,
       [](Chain& g, Edit& e) {
         e.add(Prior{pose_at(1)}, Sigma(1.0), g.a);
         e.factors(&kFactorOps<Prior<Pose3d>, IsotropicNoise>).added[0].key = placeholder_key(3);
       }},
  };
  for (std::size_t i = 0; i < spoils.size(); ++i) {
    Chain g;
    const std::uint64_t before = fingerprint(g.graph);
    for (const bool lent : {false, true}) {
      GraphEdit edit = lent ? g.graph.edit() : GraphEdit::proposal(&g.graph);
      if (lent && i >= 4) continue;  // made of placeholders that a lent edit does not give out
      spoils[i].second(g, edit);
      const auto result = g.graph.apply(edit);
      ASSERT_FALSE(result.ok()) << i;
      EXPECT_EQ(result.error().code, spoils[i].first) << i << ": " << result.error();
      EXPECT_EQ(fingerprint(g.graph), before) << i;
    }
  }
}

// V5: a message that was cut or changed on its way.
TEST(Proposal, ThatIsDamagedOnItsWayIsRefusedOrReadAndNeverBreaksTheGraph) {
  Chain g;
  GraphEdit proposal = GraphEdit::proposal(&g.graph);
  const Addition placed(proposal, g);
  Bytes bytes;
  append_edit(bytes, proposal);
  const MessageHeader header = *read_header(std::span(bytes).first(Message::kHeaderBytes));
  const std::uint64_t before = fingerprint(g.graph);
  GraphEdit read;
  for (std::size_t i = Message::kHeaderBytes; i < bytes.size(); ++i)
    for (const int bit : {0, 7}) {
      Bytes damaged = bytes;
      damaged[i] ^= std::byte{1} << bit;
      const Message message{header.kind, std::span(damaged).subspan(Message::kHeaderBytes)};
      Chain fresh;
      const std::uint64_t start = fingerprint(fresh.graph);
      ASSERT_EQ(start, before);
      if (!read_edit(message, types(), fresh.graph, read)) continue;
      if (!fresh.graph.apply(read)) {
        EXPECT_EQ(fingerprint(fresh.graph), start);
      }
    }
}

}  // namespace
}  // namespace oriel
