// Directions that are held, as an edit says them and followers hear of them.
#include "oriel/graph/freedom.h"

#include <gtest/gtest.h>

#include "graph/chain.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/graph/post_box.h"
#include "oriel/graph/wire.h"
#include "oriel/manifold/sim3.h"

namespace oriel {
namespace {

using testing::Chain;
using testing::pose_at;

TypeList types() {
  TypeList list;
  list.factor<Prior<Pose3d>, IsotropicNoise>().factor<Between<Pose3d>, IsotropicNoise>();
  return list;
}

// It follows by messages, as a worker does.
struct Follower {
  explicit Follower(Graph& followed) : origin(followed), subscription(followed.subscribe()) {}
  void look() {
    origin.collect(subscription, edit);
    Bytes bytes;
    append_edit(bytes, edit);
    const auto message = read_message(bytes);
    ASSERT_TRUE(message) << message.error();
    const auto read = read_edit(*message, types(), graph, received);
    ASSERT_TRUE(read) << read.error();
    const auto ok = graph.apply(received);
    ASSERT_TRUE(ok) << ok.error();
    EXPECT_EQ(fingerprint(graph), fingerprint(origin));
  }

  Graph& origin;
  Subscription subscription;
  Graph graph;
  GraphEdit edit, received;
};

void set(Graph& graph, VariableKey id, const Freedom& freedom) {
  GraphEdit edit = graph.edit();
  edit.set(id, freedom);
  const auto ok = graph.apply(edit);
  ASSERT_TRUE(ok) << ok.error();
}

// C3, C6
TEST(Freedom, IsSetReplacedAndTakenBackWithoutAddingOrRemovingAnything) {
  Chain g;
  Follower follower(g.graph);
  follower.look();
  const std::uint64_t free = fingerprint(g.graph), structure = g.graph.structure_version();
  for (const Freedom& f : {Freedom::position(), Freedom::yaw(), Freedom::planar(), Freedom::full()}) {
    const std::uint64_t freedoms = g.graph.freedom_version();
    set(g.graph, g.b, f);
    EXPECT_EQ(g.graph.freedom(g.b), f);
    EXPECT_GT(g.graph.freedom_version(), freedoms);
    EXPECT_EQ(fingerprint(g.graph) == free, f.is_full());
    follower.look();
    const edit::Variables* c = follower.edit.find_variables(kVariableOps<Pose3d>.key);
    EXPECT_TRUE(c->added.empty() && c->removed.empty() && c->set.empty() && c->fixed.empty());
    EXPECT_EQ(c->freedoms.size(), 1u);
    EXPECT_TRUE(follower.edit.priors().empty());
    for (const auto& factors : follower.edit.factor_columns()) EXPECT_TRUE(factors->empty());
    EXPECT_EQ(follower.graph.freedom(g.b), f);
  }
  EXPECT_EQ(g.graph.structure_version(), structure);
  for (const FactorId id : {g.between_ab, g.between_bc, g.prior_a, g.linear_b}) EXPECT_TRUE(g.graph.contains(id));
}

// C6
TEST(Freedom, SetToWhatItWasRaisesNothing) {
  Chain g;
  set(g.graph, g.b, Freedom::yaw());
  Follower follower(g.graph);
  follower.look();
  const std::uint64_t freedoms = g.graph.freedom_version();
  set(g.graph, g.b, Freedom::yaw());
  set(g.graph, g.a, Freedom::full());
  set(g.graph, g.a, Freedom::hold({}, Freedom::Axes::world));  // nothing is held, in whatever axes
  EXPECT_EQ(g.graph.freedom_version(), freedoms);
  EXPECT_EQ(g.graph.log().entries(), 0u);
  follower.look();
  EXPECT_TRUE(follower.edit.empty());
}

// C3
TEST(Freedom, SetBeforeTheFirstLookArrivesWithTheVariable) {
  Chain g;
  Follower follower(g.graph);
  GraphEdit edit = g.graph.edit();
  const auto x = edit.add(pose_at(3.0));
  edit.set(x, Freedom::yaw());  // of one that this edit adds
  ASSERT_TRUE(g.graph.apply(edit));
  set(g.graph, g.a, Freedom::rotation());
  follower.look();
  EXPECT_TRUE(follower.edit.find_variables(kVariableOps<Pose3d>.key)->freedoms.empty());
  EXPECT_EQ(follower.graph.freedom(x), Freedom::yaw());
  EXPECT_EQ(follower.graph.freedom(g.a), Freedom::rotation());
  EXPECT_EQ(follower.graph.find_pool(kVariableOps<Pose3d>.key)->restricted_count(), 2u);
}

TEST(Freedom, LeavesValueFlagAndFirstEstimateAsTheyAre) {
  Chain g;
  const VariablePool& pool = *g.graph.find_pool(kVariableOps<Pose3d>.key);
  const std::uint32_t b = pool.slots().find(g.b.key);
  ASSERT_TRUE(pool.has_first_estimate(b));  // of its linear prior
  const auto before = pool.versions(b);
  const std::uint64_t values = value_fingerprint(g.graph);
  set(g.graph, g.b, Freedom::planar());
  EXPECT_EQ(value_fingerprint(g.graph), values);
  const auto after = pool.versions(b);
  EXPECT_EQ(after.value, before.value);
  EXPECT_EQ(after.fixed, before.fixed);
  EXPECT_EQ(after.first_estimate, before.first_estimate);
  const Pose3d x = pose_at(1.0);
  EXPECT_EQ(std::memcmp(pool.first_estimate(b), &x, sizeof(x)), 0);
}

TEST(Freedom, IsGoneWithItsVariableAndNoneOfTheNextInItsPlace) {
  Chain g;
  set(g.graph, g.c, Freedom::yaw());
  GraphEdit edit = g.graph.edit();
  edit.remove(g.c);
  const auto next = edit.add(pose_at(2.0));
  ASSERT_TRUE(g.graph.apply(edit));
  EXPECT_EQ(g.graph.find_pool(kVariableOps<Pose3d>.key)->restricted_count(), 0u);
  EXPECT_EQ(g.graph.freedom(next), Freedom::full());
  EXPECT_EQ(g.graph.freedom(g.c), Freedom::full());
}

// What comes back from a solve that began before directions were held must not move them.
TEST(Freedom, KeepsASolutionOutThatBeganBeforeItWasSet) {  // C5
  Chain g;
  Solution found;
  found.version = g.graph.version();
  Solution::Column& c = found.columns.emplace_back();
  c.ops = &kVariableOps<Pose3d>;
  c.values = ByteColumn(sizeof(Pose3d));
  const Pose3d moved = pose_at(7.0);
  for (const auto id : {g.a, g.b, g.c}) c.keys.push_back(id.key), c.values.push_back(&moved);
  set(g.graph, g.a, Freedom::position());
  set(g.graph, g.b, Freedom::position());
  set(g.graph, g.b, Freedom::full());  // and may move again
  ASSERT_TRUE(g.graph.adopt(found));
  EXPECT_EQ(g.graph.value(g.a).translation()[0], 0.0);
  EXPECT_EQ(g.graph.value(g.b).translation()[0], 7.0);
  EXPECT_EQ(g.graph.value(g.c).translation()[0], 7.0);
  found.version = g.graph.version();
  ASSERT_TRUE(g.graph.adopt(found));
  EXPECT_EQ(g.graph.value(g.a).translation()[0], 7.0);  // of a solve that knew
}

// C6: whoever has no graph to look things up in says it all the same.
TEST(Freedom, IsProposedAndPostedByOneWithoutAGraph) {
  Chain g;
  PostBox box;
  GraphEdit proposal = GraphEdit::proposal();
  proposal.set(g.b, Freedom::planar());
  const auto x = proposal.add(pose_at(4.0));  // now it knows poses
  proposal.set(x, Freedom::yaw());
  const Receipt receipt = box.post(std::move(proposal));
  EXPECT_EQ(box.take(g.graph).applied, 1);
  EXPECT_EQ(g.graph.freedom(g.b), Freedom::planar());
  EXPECT_EQ(g.graph.freedom(receipt.edit().resolved(x)), Freedom::yaw());
}

template <class V>
void expect_axes_are_those_of_the_world(const V& x, int rotation_begin, int translation_begin) {
  constexpr int n = V::kDim;
  const auto B = x.world_axes();
  const auto unit = transposed_times(B, B);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) EXPECT_NEAR(unit(i, j), i == j, 1e-15) << i << j;
  // A short step along a world axis moves the value along that axis.
  constexpr double kStep = 1e-6;
  for (int k = 0; k < 3; ++k) {
    Vec<double, n> world = Vec<double, n>::zero();
    if (translation_begin >= 0) {
      world[translation_begin + k] = kStep;
      const Vec3d t = x.plus(transposed_times(B, world)).translation() - x.translation();
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(t[i], i == k ? t[k] : 0.0, 1e-14);
      EXPECT_GT(t[k], 0.5 * kStep);
    }
    world = Vec<double, n>::zero();
    world[rotation_begin + k] = kStep;
    const Vec3d turn = (x.plus(transposed_times(B, world)).rotation() * x.rotation().inverse()).log();
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(turn[i], i == k ? kStep : 0.0, 1e-14);
  }
}

TEST(Freedom, NamesDirectionsInTheAxesOfTheWorldWhereATypeHasThem) {
  const Vec6d d{{0.4, -1.1, 0.7, 3.0, -2.0, 0.5}};
  expect_axes_are_those_of_the_world(Pose3d{}.plus(d), 0, 3);
  Sim3d s;
  s.R = Pose3d{}.plus(d).R, s.t = {{1, 2, 3}}, s.s = 2.5;
  expect_axes_are_those_of_the_world(s, 0, 3);
  const Rot3d R = s.R;
  const Vec3d turn = (R.plus(transposed_times(R.world_axes(), Vec3d{{0, 0, 1e-6}})) * R.inverse()).log();
  EXPECT_NEAR(turn[2], 1e-6, 1e-14);
  const Pose2d p = Pose2d{}.plus({{0.7, 1.0, 2.0}});
  const Vec2d t = p.plus(transposed_times(p.world_axes(), Vec3d{{0, 0, 1e-6}})).translation() - p.translation();
  EXPECT_NEAR(t[0], 0.0, 1e-15);
  EXPECT_NEAR(t[1], 1e-6, 1e-15);
}

// Each maker's free directions are closed under composition: what is held stays, after however many steps.
template <class Held>
void expect_held(const Freedom& freedom, Held&& held) {
  Pose3d x = Pose3d{}.plus({{0.3, -0.4, 2.0, 1.0, -2.0, 3.0}});
  const auto at_first = held(x);
  unsigned random = 1;
  double moved = 0.0;
  for (int step = 0; step < 1000; ++step) {
    Vec6d y;
    for (int k = 0; k < 6; ++k) {
      random = random * 1664525u + 1013904223u;
      y[k] = freedom.holds(k) ? 0.0 : (random >> 8) / double(1 << 24) - 0.5;
    }
    const Vec6d d = freedom.axes == Freedom::Axes::world ? transposed_times(x.world_axes(), y) : y;
    const Pose3d before = x;
    x = x.plus(d);
    moved = std::max(moved, x.minus(before).norm());
  }
  EXPECT_GT(moved, 0.4);
  const auto at_last = held(x);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(at_last[k], at_first[k], 1e-13) << k;
}

TEST(Freedom, OfEachMakerKeepsWhatItHoldsAfterAThousandSteps) {
  const auto up_in_body = [](const Pose3d& x) { return x.rotation().inverse() * Vec3d{{0, 0, 1}}; };  // roll and pitch
  const auto position = [](const Pose3d& x) { return x.translation(); };
  expect_held(Freedom::position(),
              [](const Pose3d& x) { return x.rotation().vec() * (x.rotation().qw < 0 ? -1.0 : 1.0); });
  expect_held(Freedom::rotation(), position);
  expect_held(Freedom::yaw(), position);
  expect_held(Freedom::yaw(), up_in_body);
  expect_held(Freedom::yaw_and_position(), up_in_body);
  expect_held(Freedom::planar(), up_in_body);
  expect_held(Freedom::planar(), [](const Pose3d& x) { return Vec3d{{0, 0, x.translation()[2]}}; });
}

}  // namespace
}  // namespace oriel
