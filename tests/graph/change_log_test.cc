// Followers: what each has not seen, net, at its own pace.
#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

#include "graph/random_graph.h"
#include "oriel/graph/fingerprint.h"

namespace oriel {
namespace {

using testing_graph::RandomGraph;

// A graph that follows another.
struct Follower {
  explicit Follower(Graph& followed) : origin(followed), subscription(followed.subscribe()) {}
  // The net edit is applied; what it said stays in `edit`.
  void look() {
    origin.collect(subscription, edit);
    const auto ok = graph.apply(edit);
    ASSERT_TRUE(ok) << ok.error();
  }

  Graph& origin;
  Subscription subscription;
  Graph graph;
  GraphEdit edit;
};

std::size_t added_factors(const GraphEdit& edit) {
  std::size_t n = edit.priors().added.size();
  for (const auto& c : edit.factor_columns()) n += c->added.size();
  return n;
}

// The graph holds what the model says, and nothing else.
void expect_model(const Graph& graph, const RandomGraph& model) {
  ASSERT_EQ(graph.variable_count(), model.variables().size());
  ASSERT_EQ(graph.factor_count(), model.factors().size() + model.prior_count());
  for (const auto& v : model.variables()) {
    ASSERT_NE(graph.find_value(v.id), nullptr) << graph.describe(v.id);
    EXPECT_EQ(graph.fixed(v.id), v.fixed) << graph.describe(v.id);
    EXPECT_EQ(graph.describe(v.id), model.graph.describe(v.id));
  }
  for (const auto& f : model.factors()) EXPECT_TRUE(graph.contains(f.id));
}

// C1
TEST(ChangeLog, GivesTheWholeGraphOnceAndThenOnlyWhatIsNew) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Pose3d{}, Label("start"));
  const auto b = edit.add(Pose3d{});
  edit.add(Between{Pose3d{}}, Sigma(1.0), a, b);
  ASSERT_TRUE(graph.apply(edit));

  Follower late(graph);
  late.look();
  EXPECT_EQ(fingerprint(late.graph), fingerprint(graph));
  EXPECT_EQ(late.graph.describe(a), "pose3/1 'start'");
  late.look();
  EXPECT_TRUE(late.edit.empty());

  edit.clear();
  const auto c = edit.add(Pose3d{});
  ASSERT_TRUE(graph.apply(edit));
  late.look();
  EXPECT_EQ(late.edit.find_variables(kVariableOps<Pose3d>.key)->added.size(), 1u);
  EXPECT_EQ(added_factors(late.edit), 0u);
  EXPECT_TRUE(late.graph.contains(c));
}

// C1
TEST(ChangeLog, KeepsSerialOrderWhateverSlotsAreUsedAgain) {
  Graph graph;
  GraphEdit edit = graph.edit();
  std::vector<VariableId<Point3d>> ids;
  for (int i = 0; i < 20; ++i) ids.push_back(edit.add(Point3d{{{1.0 * i, 0, 0}}}));
  ASSERT_TRUE(graph.apply(edit));
  Follower follower(graph);
  follower.look();
  edit.clear();
  for (int i = 0; i < 20; i += 2) edit.remove(ids[static_cast<std::size_t>(i)]);
  ASSERT_TRUE(graph.apply(edit));
  edit.clear();
  for (int i = 0; i < 15; ++i) edit.add(Point3d{{{100.0 + i, 0, 0}}});
  ASSERT_TRUE(graph.apply(edit));
  follower.look();
  std::vector<double> origin, replica;
  graph.for_each<Point3d>([&](auto, const Point3d& p) { origin.push_back(p.p[0]); });
  follower.graph.for_each<Point3d>([&](auto, const Point3d& p) { replica.push_back(p.p[0]); });
  EXPECT_EQ(origin, replica);
  EXPECT_TRUE(std::is_sorted(replica.begin(), replica.end()));
}

// C1, C2, C3, C4
TEST(ChangeLog, MakesThreeFollowersOfDifferentPaceEqualToARandomGraph) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    RandomGraph origin(seed);
    Follower every(origin.graph), often(origin.graph), seldom(origin.graph);
    for (int round = 0; round < 300; ++round) {
      ASSERT_TRUE(origin.step(6));
      every.look();
      ASSERT_EQ(fingerprint(every.graph), fingerprint(origin.graph)) << "seed " << seed << ", round " << round;
      if (origin.below(3) == 0) {
        often.look();
        ASSERT_EQ(fingerprint(often.graph), fingerprint(origin.graph)) << "seed " << seed << ", round " << round;
      }
      if (origin.below(40) == 0) {
        seldom.look();
        ASSERT_EQ(fingerprint(seldom.graph), fingerprint(origin.graph)) << "seed " << seed << ", round " << round;
      }
    }
    seldom.look();
    expect_model(origin.graph, origin);
    expect_model(seldom.graph, origin);
    expect_model(every.graph, origin);
  }
}

// C1, C3
TEST(ChangeLog, TellsOfALossThatWasSetWithoutAddingOrRemoving) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Pose3d{});
  const FactorId kept = edit.add(Prior{Pose3d{}}, Sigma(1.0), Huber(1.0), a);
  const FactorId removed = edit.add(Prior{Pose3d{}}, Sigma(2.0), a);
  ASSERT_TRUE(graph.apply(edit));
  Follower follower(graph);
  follower.look();
  for (const double scale : {2.0, 3.0}) {
    GraphEdit set = graph.edit();
    set.set(kept, Cauchy(scale));
    set.set(removed, Cauchy(scale));
    ASSERT_TRUE(graph.apply(set));
  }
  GraphEdit out = graph.edit();
  out.remove(removed);
  ASSERT_TRUE(graph.apply(out));
  follower.look();
  EXPECT_EQ(added_factors(follower.edit), 0u);
  EXPECT_EQ(fingerprint(follower.graph), fingerprint(graph));
  EXPECT_EQ(follower.graph.tables()[0]->loss(0).scale, 3.0);
  const std::uint64_t before = fingerprint(graph);
  for (const auto& [id, loss] : {std::pair{removed, Huber(1.0)}, std::pair{kept, Huber(-1.0)}}) {
    GraphEdit bad = graph.edit();
    bad.set(id, loss);
    EXPECT_FALSE(graph.apply(bad));
    EXPECT_EQ(fingerprint(graph), before);
  }
}

// C1
TEST(ChangeLog, GivesAFollowerThatJoinsLateTheGraphAsItIs) {
  RandomGraph origin(17);
  for (int round = 0; round < 100; ++round) ASSERT_TRUE(origin.step(5));
  Follower late(origin.graph);
  late.look();
  EXPECT_EQ(fingerprint(late.graph), fingerprint(origin.graph));
  origin.graph.unsubscribe(late.subscription);
  Follower again(origin.graph);  // takes the place of the one that left, and has seen nothing
  again.look();
  EXPECT_EQ(fingerprint(again.graph), fingerprint(origin.graph));
}

// C2
TEST(ChangeLog, IsSilentOnWhatCameAndWentBetweenTwoLooks) {
  Graph graph;
  Follower follower(graph);
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Pose3d{});
  const FactorId f = edit.add(Prior{Pose3d{}}, Sigma(1.0), a);
  ASSERT_TRUE(graph.apply(edit));
  edit.clear();
  edit.remove(f);
  ASSERT_TRUE(graph.apply(edit));
  edit.clear();
  edit.remove(a);
  ASSERT_TRUE(graph.apply(edit));
  follower.look();
  EXPECT_TRUE(follower.edit.empty());
}

// C2
TEST(ChangeLog, TellsOnceOfARemovalFollowedByANewItemInTheSameSlot) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Pose3d{});
  ASSERT_TRUE(graph.apply(edit));
  Follower follower(graph);
  follower.look();
  VariableId<Pose3d> last = a;
  for (int i = 0; i < 3; ++i) {  // removed, added, removed, added, ...
    edit.clear();
    edit.remove(last);
    ASSERT_TRUE(graph.apply(edit));
    edit.clear();
    last = edit.add(Pose3d{});
    EXPECT_EQ(last.key.index, a.key.index);
    ASSERT_TRUE(graph.apply(edit));
  }
  follower.look();
  const edit::Variables* c = follower.edit.find_variables(kVariableOps<Pose3d>.key);
  EXPECT_EQ(c->removed.size(), 1u);
  EXPECT_EQ(c->added.size(), 1u);
  EXPECT_FALSE(follower.graph.contains(a));
  EXPECT_TRUE(follower.graph.contains(last));

  edit.clear();
  edit.remove(last);
  ASSERT_TRUE(graph.apply(edit));
  follower.look();
  EXPECT_EQ(follower.graph.variable_count(), 0u);
}

// C3
TEST(ChangeLog, TellsOfValuesAndFlagsWithoutAddingOrRemoving) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto p = edit.add(Point3d{});
  const auto q = edit.add(Point3d{});
  ASSERT_TRUE(graph.apply(edit));
  Follower follower(graph);
  follower.look();
  for (const double x : {1.0, 2.0}) {
    edit.clear();
    edit.set(p, Point3d{{{x, 0, 0}}});
    edit.fix(q, x == 2.0);
    ASSERT_TRUE(graph.apply(edit));
  }
  follower.look();
  const edit::Variables* c = follower.edit.find_variables(kVariableOps<Point3d>.key);
  EXPECT_TRUE(c->added.empty());
  EXPECT_TRUE(c->removed.empty());
  EXPECT_EQ(c->set.size(), 1u);  // the last value alone
  EXPECT_EQ(c->fixed.size(), 1u);
  EXPECT_EQ(follower.graph.value(p).p[0], 2.0);
  EXPECT_TRUE(follower.graph.fixed(q));
}

// C3
TEST(ChangeLog, DeliversWhatWasSetBeforeTheFirstLookWithTheVariableItself) {
  Graph graph;
  Follower follower(graph);
  GraphEdit edit = graph.edit();
  const auto p = edit.add(Point3d{});
  ASSERT_TRUE(graph.apply(edit));
  edit.clear();
  edit.set(p, Point3d{{{7.0, 0, 0}}});
  edit.fix(p);
  ASSERT_TRUE(graph.apply(edit));
  follower.look();
  const edit::Variables* c = follower.edit.find_variables(kVariableOps<Point3d>.key);
  EXPECT_TRUE(c->set.empty());
  EXPECT_TRUE(c->fixed.empty());
  EXPECT_EQ(follower.graph.value(p).p[0], 7.0);
  EXPECT_TRUE(follower.graph.fixed(p));
}

// C5
TEST(ChangeLog, IsSilentOnWhatAnEngineFound) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto p = edit.add(Point3d{});
  const auto held = edit.add(Point3d{});
  const auto newer = edit.add(Point3d{});
  edit.fix(held);
  ASSERT_TRUE(graph.apply(edit));
  Follower follower(graph);
  follower.look();
  Solution solution;
  solution.version = graph.version();
  const Point3d found{{{5.0, 0, 0}}};
  Solution::Column& c = solution.columns.emplace_back();
  c.ops = &kVariableOps<Point3d>;
  c.values = ByteColumn(sizeof(Point3d));
  for (const auto id : {p, held, newer}) {
    c.keys.push_back(id.key);
    c.values.push_back(&found);
  }
  edit.clear();
  edit.set(newer, Point3d{{{9.0, 0, 0}}});  // by the user, while the engine was at work
  ASSERT_TRUE(graph.apply(edit));
  ASSERT_TRUE(graph.adopt(solution));
  EXPECT_EQ(graph.value(p).p[0], 5.0);
  EXPECT_EQ(graph.value(held).p[0], 0.0);
  EXPECT_EQ(graph.value(newer).p[0], 9.0);
  follower.look();
  EXPECT_EQ(follower.edit.find_variables(kVariableOps<Point3d>.key)->set.size(), 1u);  // the user's
  EXPECT_EQ(follower.graph.value(p).p[0], 0.0);
}

// C6
TEST(ChangeLog, IsSilentOnAFlagThatIsSetToWhatItWas) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto p = edit.add(Point3d{});
  ASSERT_TRUE(graph.apply(edit));
  Follower follower(graph);
  follower.look();
  edit.clear();
  edit.fix(p, false);
  ASSERT_TRUE(graph.apply(edit));
  follower.look();
  EXPECT_TRUE(follower.edit.empty());
}

}  // namespace
}  // namespace oriel
