// Solves where directions of variables are held, against dense algebra on the free directions and against problems
// whose variables have no others.
#include "oriel/graph/freedom.h"

#include <gtest/gtest.h>

#include "oriel/graph/fingerprint.h"
#include "oriel/manifold/se2.h"
#include "oriel/solve/native_engine.h"
#include "oriel/testing/allocation_counter.h"
#include "solve/freedom_world.h"

namespace oriel {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing_freedom::Dense;
using testing_freedom::dense_of;
using testing_freedom::World;

// A graph equal to another one.
void copy(Graph& from, Graph& to) {
  GraphEdit whole;
  const Subscription s = from.subscribe();
  from.collect(s, whole);
  from.unsubscribe(s);
  ASSERT_TRUE(to.apply(whole));
}

// One step of Gauss–Newton from where the graph is; how far each variable is from where dense algebra puts it.
double distance_from_dense_step(Graph& graph, const SolveOptions& options, bool* panel = nullptr) {
  const Dense d = dense_of(graph);
  const VectorXd step = d.step();
  std::vector<std::vector<std::byte>> expected;
  for (const auto& [id, offset] : d.place) {
    const VariableOps& ops = *graph.find_ops(id.type);
    const std::int32_t zero = 0;
    expected.emplace_back(ops.bytes);
    ops.plus(1, graph.find_value(id), step.data() + offset, &zero, expected.back().data());
  }
  NativeEngine engine(graph);
  const Summary s = engine.solve(options);
  EXPECT_EQ(s.accepted, 1) << s;
  if (panel != nullptr) *panel = engine.structure().landmark_panel();
  double worst = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const VariableOps& ops = *graph.find_ops(d.place[i].first.type);
    std::vector<double> off(static_cast<std::size_t>(ops.dim));
    ops.minus(graph.find_value(d.place[i].first), expected[i].data(), off.data());
    for (const double x : off) worst = std::max(worst, std::fabs(x));
  }
  EXPECT_GT(step.norm(), 1e-2);
  return worst;
}

const SolveOptions kOneStep{.method = Method::gauss_newton, .max_iterations = 1, .first_estimates = false};

// C6: H ← P H P + (I - P), with landmarks and without, in one panel and one by one, with and without a linear prior.
TEST(FreedomSolve, StepsWhereDenseAlgebraOnTheFreeDirectionsSteps) {
  bool panels[2] = {};
  for (const int sight : {2, 9})
    for (const bool points : {false, true})
      for (const bool prior : {false, true}) {
        World w(9, 30, sight);
        w.restrict_some();
        if (prior) w.add_prior();
        GraphEdit edit = w.graph.edit();
        for (const auto id : w.points)
          if (!points) edit.remove(id);
        ASSERT_TRUE(w.graph.apply(edit));
        bool panel = false;
        EXPECT_LT(distance_from_dense_step(w.graph, kOneStep, &panel), 1e-10) << sight << points << prior;
        if (points) panels[panel] = true;
      }
  EXPECT_TRUE(panels[0] && panels[1]);
}

// C6: set, replaced and taken back between the solves of one engine.
TEST(FreedomSolve, FollowsWhatIsSetReplacedAndTakenBack) {
  World w;
  NativeEngine engine(w.graph);
  const Freedom in_turn[] = {Freedom::full(), Freedom::yaw(), Freedom::planar(), Freedom::position(), Freedom::full()};
  for (const Freedom& f : in_turn) {
    for (const std::size_t k : {2u, 3u, 6u}) w.set(w.poses[k], f);
    w.set(w.points[4], f.is_full() ? f : Freedom::hold({1}));
    const auto ok = check(engine, w.graph);
    ASSERT_TRUE(ok) << ok.error();
    Graph same;
    copy(w.graph, same);
    EXPECT_LT(distance_from_dense_step(same, kOneStep), 1e-10);
    ASSERT_EQ(engine.solve(kOneStep).accepted, 1);
    EXPECT_EQ(fingerprint(w.graph), fingerprint(same));  // the one that followed and one made anew: the same bits
    for (const auto id : w.poses) {                      // off again
      GraphEdit edit = w.graph.edit();
      edit.set(id, w.graph.value(id).plus(w.six(0.05)));
      ASSERT_TRUE(w.graph.apply(edit));
    }
  }
}

struct Kind {
  Method method;
  LinearSolver solver;
};
constexpr Kind kKinds[] = {{Method::levenberg_marquardt, LinearSolver::direct},
                           {Method::gauss_newton, LinearSolver::direct},
                           {Method::dogleg, LinearSolver::direct},
                           {Method::levenberg_marquardt, LinearSolver::conjugate_gradient},
                           {Method::dogleg, LinearSolver::conjugate_gradient}};

SolveOptions options_of(const Kind& kind) {
  SolveOptions options;
  options.method = kind.method, options.linear_solver = kind.solver;
  options.function_tolerance = 1e-15, options.max_iterations = 200;
  options.conjugate_gradient.forcing = 1e-12;
  return options;
}

// Roll and pitch of a pose: the world's upward direction in the body.
Vec3d up_in_body(const Pose3d& x) { return x.rotation().inverse() * Vec3d{{0, 0, 1}}; }

// C6: whatever finds the steps, damped or cut short; the gradient at the end is that of the free directions.
TEST(FreedomSolve, EndsAtTheOptimumOfTheFreeDirectionsWithTheHeldOnesAsTheyWere) {
  for (const Kind& kind : kKinds) {
    World w(8, 24, 3, 0.15);
    for (const auto id : w.poses) w.set(id, Freedom::planar());
    w.set(w.poses[0], Freedom::rotation());
    w.set(w.points[3], Freedom::hold({1}));
    std::vector<Pose3d> before;
    for (const auto id : w.poses) before.push_back(w.graph.value(id));
    const double y = w.graph.value(w.points[3]).p[1];
    NativeEngine engine(w.graph);
    const Summary s = engine.solve(options_of(kind));
    EXPECT_TRUE(s.converged()) << s;
    EXPECT_GT(s.accepted, 2);
    EXPECT_LT(s.final_cost, 0.5 * s.initial_cost);
    const Dense d = dense_of(w.graph);
    const double held = d.g.cwiseAbs().maxCoeff();
    EXPECT_LT((d.N.transpose() * d.g).cwiseAbs().maxCoeff(), 1e-7 * held) << s;
    EXPECT_GT(held, 1.0) << "the held directions pull";
    EXPECT_NEAR(s.gradient, 0.0, 1e-3);
    for (std::size_t i = 1; i < before.size(); ++i) {
      const Pose3d x = w.graph.value(w.poses[i]);
      EXPECT_LT((up_in_body(x) - up_in_body(before[i])).norm(), 1e-14);
      EXPECT_NEAR(x.translation()[2], before[i].translation()[2], 1e-14);
      EXPECT_GT(x.minus(before[i]).norm(), 1e-3);
    }
    EXPECT_EQ((w.graph.value(w.poses[0]).translation() - before[0].translation()).norm(), 0.0);
    EXPECT_EQ(w.graph.value(w.points[3]).p[1], y);
  }
}

// A measured pose between two, whatever parametrizes them.
template <class S>
Vec<S, 6> relative_error(const Pose3d& z, const Pose3<S>& a, const Pose3<S>& b) {
  return (cast<S>(z).inverse() * (a.inverse() * b)).log();
}
struct Relative {
  static constexpr std::string_view kName = "test.relative/1";
  using Variables = Types<Pose3d, Pose3d>;
  Pose3d z;
  template <class S>
  Vec<S, 6> operator()(const Pose3<S>& a, const Pose3<S>& b) const {
    return relative_error(z, a, b);
  }
};
// The same of poses that have yaw and position in the plane only; what else there is of them is a constant.
struct PlanarRelative {
  static constexpr std::string_view kName = "test.planar_relative/1";
  using Variables = Types<Pose2d, Pose2d>;
  Pose3d z, a0, b0;  // of a0 and b0 tilt and height are taken
  template <class S>
  static Pose3<S> lift(const Pose2<S>& x, const Pose3d& rest) {
    const S o(0.0);
    return {Rot3<S>::exp({{o, o, x.R.log()}}) * cast<S>(rest.R), {{x.t[0], x.t[1], S(rest.t[2])}}};
  }
  template <class S>
  Vec<S, 6> operator()(const Pose2<S>& a, const Pose2<S>& b) const {
    return relative_error(z, lift(a, a0), lift(b, b0));
  }
};

// C6: an oracle that knows nothing of projections: the same problem in variables that have no other directions.
TEST(FreedomSolve, FindsTheOptimumOfVariablesThatHaveNoOtherDirections) {
  World w(0, 0);
  Graph planar, poses;
  GraphEdit in_plane = planar.edit(), in_space = poses.edit();
  std::vector<VariableId<Pose2d>> a;
  std::vector<VariableId<Pose3d>> b;
  std::vector<Pose3d> rest;
  for (int i = 0; i < 20; ++i) {
    const Rot3d tilt = Rot3d::exp({{0.1 * (i % 3), -0.15 * (i % 4), 0.0}});
    rest.push_back({tilt, {{0, 0, 0.2 * (i % 5)}}});
    const Pose2d x = Pose2d{}.plus({{0.3 * i, 0, 0}}).plus({{w.number(0.1), w.number(0.1), w.number(0.1)}});
    a.push_back(in_plane.add(x));
    b.push_back(in_space.add(PlanarRelative::lift(x, rest.back())));
  }
  auto tie = [&](std::size_t i, std::size_t k) {
    const Pose3d z = Pose3d{}.plus({{0, 0, 0.3, 1, 0, 0}}).plus(w.six(0.1));
    in_plane.add(PlanarRelative{z, rest[i], rest[k]}, Sigma(0.2), Huber(3.0), a[i], a[k]);
    in_space.add(Relative{z}, Sigma(0.2), Huber(3.0), b[i], b[k]);
  };
  for (std::size_t i = 0; i + 1 < a.size(); ++i) tie(i, i + 1);
  for (std::size_t i = 0; i + 7 < a.size(); i += 3) tie(i, i + 7);
  for (std::size_t i = 0; i < b.size(); ++i) in_space.set(b[i], Freedom::planar());
  in_plane.fix(a[0]), in_space.fix(b[0]);
  ASSERT_TRUE(planar.apply(in_plane));
  ASSERT_TRUE(poses.apply(in_space));
  const SolveOptions options{.max_iterations = 400, .function_tolerance = 1e-15};
  const Summary x = NativeEngine(planar).solve(options), y = NativeEngine(poses).solve(options);
  EXPECT_TRUE(x.converged() && y.converged()) << x << y;
  EXPECT_NEAR(x.initial_cost, y.initial_cost, 1e-10 * x.initial_cost);
  EXPECT_NEAR(x.final_cost, y.final_cost, 1e-10 * x.final_cost);
  EXPECT_LT(x.final_cost, 0.9 * x.initial_cost);
  for (std::size_t i = 0; i < a.size(); ++i)
    EXPECT_LT(poses.value(b[i]).minus(PlanarRelative::lift(planar.value(a[i]), rest[i])).norm(), 1e-6) << i;
}

// L10
TEST(FreedomSolve, HasTheSameBitsForAnyNumberOfThreadsAndWithCachesDropped) {
  for (const Kind& kind : kKinds)
    for (const int sight : {2, 8}) {
      std::vector<std::uint64_t> bits;
      for (const int threads : {1, 2, 3}) {
        World w(40, 300, sight);
        w.restrict_some();
        w.add_prior();
        NativeEngine engine(w.graph);
        SolveOptions options = options_of(kind);
        options.threads = threads, options.max_iterations = 2;
        ASSERT_GT(engine.solve(options).accepted, 0);
        if (threads == 3) engine.drop_caches();
        w.set(w.poses[2], Freedom::full());
        w.set(w.poses[7], Freedom::yaw_and_position());
        ASSERT_GT(engine.solve(options).accepted, 0);
        bits.push_back(fingerprint(w.graph));
      }
      EXPECT_EQ(bits[0], bits[1]);
      EXPECT_EQ(bits[0], bits[2]);
    }
}

// C3: a freedom alone changes numbers and no layout, of landmarks either.
TEST(FreedomSolve, DoesNoSymbolicWorkForAFreedom) {
  World w;
  NativeEngine engine(w.graph);
  ASSERT_GT(engine.solve(kOneStep).accepted, 0);
  const std::uint64_t layouts = engine.structure().version();
  const std::int64_t analyses = engine.structure().factorization().analyses();
  w.restrict_some();
  ASSERT_GT(engine.solve(kOneStep).accepted, 0);
  EXPECT_FALSE(engine.restriction().empty());
  for (const auto id : w.poses) w.set(id, Freedom::full());
  for (const auto id : w.points) w.set(id, Freedom::full());
  for (const auto id : w.velocities) w.set(id, Freedom::full());
  ASSERT_TRUE(engine.sync());
  EXPECT_TRUE(engine.restriction().empty());
  EXPECT_EQ(engine.structure().version(), layouts);
  EXPECT_EQ(engine.structure().factorization().analyses(), analyses);
}

TEST(FreedomSolve, AsksForNoMemoryFromTheSecondIterationOn) {
  if (!counts_allocations()) GTEST_SKIP() << "the sanitizer has an operator new of its own";
  World w(8, 24, 3, 0.15);
  w.restrict_some();
  NativeEngine engine(w.graph);
  std::int64_t at[60] = {};
  SolveOptions options;
  options.max_iterations = 30, options.function_tolerance = 0.0;
  options.callback = [&](const IterationReport& r) {
    at[r.iteration] = allocation_count();
    return true;
  };
  const Summary s = engine.solve(options);
  ASSERT_GE(s.iterations, 4);
  for (int i = 2; i <= s.iterations && at[i] > 0; ++i) EXPECT_EQ(at[i] - at[1], 0) << "iteration " << i;
  for (int again = 0; again < 2; ++again) {  // set anew in between, too
    w.set(w.poses[2], again == 0 ? Freedom::yaw() : Freedom::planar());
    const std::int64_t before = allocation_count();
    ASSERT_TRUE(engine.sync());
    EXPECT_EQ(allocation_count(), before);
  }
}

// L11: P Σ P, zero in what is held.
TEST(FreedomSolve, HasTheCovarianceOfDenseAlgebraOnTheFreeDirections) {
  for (const int sight : {2, 9}) {
    World w(9, 30, sight);
    w.restrict_some();
    NativeEngine engine(w.graph);
    ASSERT_TRUE(engine.solve({.first_estimates = false}).converged());
    const Dense d = dense_of(w.graph);
    const MatrixXd covariance = d.covariance();
    const std::vector<VariableKey> ids = {w.poses[1], w.points[0], w.velocities[1],
                                          w.poses[5], w.poses[4],  w.points[2]};
    const auto joint = engine.joint_covariance(ids);
    ASSERT_TRUE(joint) << joint.error();
    std::vector<int> scalars;
    for (const VariableKey& id : ids)
      for (int k = 0; k < w.graph.find_ops(id.type)->dim; ++k) scalars.push_back(d.at(id) + k);
    const std::size_t n = scalars.size();
    ASSERT_EQ(joint->size(), n * n);
    for (std::size_t r = 0; r < n; ++r)
      for (std::size_t c = 0; c < n; ++c)
        EXPECT_NEAR((*joint)[c * n + r], covariance(scalars[r], scalars[c]),
                    1e-9 * std::sqrt(covariance.diagonal().maxCoeff() * covariance.diagonal().maxCoeff()));
    const auto held = engine.covariance(w.points[0]);
    ASSERT_TRUE(held);
    for (int k = 0; k < 3; ++k) EXPECT_EQ((*held)(2, k), 0.0);
    EXPECT_GT((*held)(0, 0), 0.0);
  }
}

// Decision 9: Jacobians at first estimates, steps along what is free at the value that they leave from.
TEST(FreedomSolve, HoldsWhatIsHeldAlsoWithJacobiansElsewhere) {
  World w(6, 12, 3);
  GraphEdit edit = w.graph.edit();
  std::vector<Pose3d> before;
  for (const auto id : w.poses) {
    before.push_back(w.graph.value(id));
    edit::Variables& c = edit.variables(&kVariableOps<Pose3d>);
    const Pose3d elsewhere = before.back().plus({{0.2, -0.1, 0.1, 0.05, 0.0, 0.1}});
    c.set.emplace_back(id.key, edit::SetKind::first_estimate);
    c.set_values.push_back(&elsewhere);
    edit.set(id, Freedom::yaw_and_position());
  }
  ASSERT_TRUE(w.graph.apply(edit));
  const Summary s = NativeEngine(w.graph).solve({.max_iterations = 30});
  EXPECT_GT(s.accepted, 2) << s;
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_LT((up_in_body(w.graph.value(w.poses[i])) - up_in_body(before[i])).norm(), 1e-14);
    EXPECT_GT(w.graph.value(w.poses[i]).minus(before[i]).norm(), 1e-3);
  }
}

// C7
TEST(FreedomSolve, IsPartOfWhatAnEngineIsComparedBy) {
  World w;
  w.restrict_some();
  NativeEngine engine(w.graph);
  auto contents = engine.contents();
  ASSERT_TRUE(contents) << contents.error();
  EXPECT_TRUE(compare_contents(w.graph, expected_contents(w.graph), *contents));
  w.set(w.poses[1], Freedom::planar());
  const auto ok = compare_contents(w.graph, expected_contents(w.graph), *contents);
  ASSERT_FALSE(ok);
  EXPECT_NE(ok.error().text().find("holds other directions of pose3/1 'x1'"), std::string::npos) << ok.error();
}

}  // namespace
}  // namespace oriel
