// Edits: ids before the thing exists, whole or not at all, and what removal takes along.
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <map>
#include <random>

#include "oriel/graph/fingerprint.h"
#include "oriel/graph/graph.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"

namespace oriel {
namespace {

const double kNan = std::numeric_limits<double>::quiet_NaN();

Pose3d pose_at(double x) {
  Vec6d d = Vec6d::zero();
  d[3] = x;
  return Pose3d{}.plus(d);
}

// A prior over one pose at `x`: 6 rows, R = I.
LinearPrior unit_prior(VariableId<Pose3d> id, const Pose3d& x) {
  LinearPrior p;
  p.variables = {id};
  p.estimates.resize(estimate_doubles(kVariableOps<Pose3d>));
  std::memcpy(p.estimates.data(), &x, sizeof(x));
  p.rows = p.cols = 6;
  p.d.assign(6, 0.0);
  p.R.assign(36, 0.0);
  for (std::size_t i = 0; i < 6; ++i) p.R[i * 7] = 1.0;
  return p;
}

// Three poses in a chain, a point, two priors of the two kinds.
struct Chain {
  Graph graph;
  VariableId<Pose3d> a, b, c, gone;
  FactorId between_ab, between_bc, prior_a, linear_b, gone_factor;

  Chain() {
    GraphEdit edit = graph.edit();
    a = edit.add(pose_at(0.0), Label("a"));
    b = edit.add(pose_at(1.0));
    c = edit.add(pose_at(2.0));
    gone = edit.add(pose_at(9.0));
    prior_a = edit.add(Prior{pose_at(0.0)}, Sigma(0.1), a);
    between_ab = edit.add(Between{pose_at(1.0)}, Sigma(0.1), a, b);
    between_bc = edit.add(Between{pose_at(1.0)}, Sigma(0.1), Huber(1.0), b, c);
    gone_factor = edit.add(Prior{pose_at(9.0)}, Sigma(0.1), gone);
    linear_b = edit.add(unit_prior(b, pose_at(1.0)));
    EXPECT_TRUE(graph.apply(edit));
    GraphEdit removal = graph.edit();
    removal.remove(gone);
    EXPECT_TRUE(graph.apply(removal));
  }
};

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
  const std::string id = "#" + std::to_string(g.gone.key.index) + "." + std::to_string(g.gone.key.generation);
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

// ---- refusals ----

struct Refusal {
  const char* name;
  ErrorCode code;
  const char* names;  // what the message has to say
  std::function<void(Chain&, GraphEdit&)> spoil;
};

Mat6d indefinite() {
  Mat6d m = Mat6d::identity();
  m(4, 4) = -1.0;
  return m;
}
struct Stranger {  // a variable type that the graph never met
  static constexpr std::string_view kName = "test.stranger/1";
  static constexpr int kDim = 1;
  double x = 0.0;
  Stranger plus(const Vec1d& d) const { return {x + d[0]}; }
  Vec1d minus(const Stranger& o) const { return {x - o.x}; }
};

std::vector<Refusal> refusals() {
  using E = GraphEdit;
  return {
      {"a stale id in a factor", ErrorCode::stale_id, "#3.1",
       [](Chain& g, E& e) { e.add(Prior{pose_at(0)}, Sigma(1), g.gone); }},
      {"an unknown id in a factor", ErrorCode::stale_id, "#77.1",
       [](Chain&, E& e) { e.add(Prior{pose_at(0)}, Sigma(1), VariableId<Pose3d>{{77, 1}}); }},
      {"an id of a type without variables", ErrorCode::stale_id, "point3/1",
       [](Chain&, E& e) { e.add(Prior{Point3d{}}, Sigma(1), VariableId<Point3d>{{0, 1}}); }},
      {"a removed stale id", ErrorCode::stale_id, "#3.1", [](Chain& g, E& e) { e.remove(g.gone); }},
      {"a removed id of an unknown type", ErrorCode::stale_id, "type",
       [](Chain&, E& e) { e.remove(VariableId<Stranger>{{0, 1}}); }},
      {"a fixed id of an unknown type", ErrorCode::stale_id, "type",
       [](Chain&, E& e) { e.fix(VariableId<Stranger>{{0, 1}}); }},
      {"a removed factor of an unknown table", ErrorCode::stale_id, "table",
       [](Chain&, E& e) { e.remove(FactorId{123, {0, 1}}); }},
      {"a set stale id", ErrorCode::stale_id, "#3.1", [](Chain& g, E& e) { e.set(g.gone, pose_at(1)); }},
      {"a fixed stale id", ErrorCode::stale_id, "#3.1", [](Chain& g, E& e) { e.fix(g.gone); }},
      {"a removed stale factor", ErrorCode::stale_id, "prior/1", [](Chain& g, E& e) { e.remove(g.gone_factor); }},
      {"a removed stale linear prior", ErrorCode::stale_id, "linear prior",
       [](Chain&, E& e) { e.remove(FactorId{PriorTable::kKey, {5, 1}}); }},
      {"the same variable removed twice", ErrorCode::duplicate, "'a'",
       [](Chain& g, E& e) { e.remove(g.a), e.remove(g.a); }},
      {"the same factor removed twice", ErrorCode::duplicate, "twice",
       [](Chain& g, E& e) { e.remove(g.between_ab), e.remove(g.between_ab); }},
      {"the same linear prior removed twice", ErrorCode::duplicate, "twice",
       [](Chain& g, E& e) { e.remove(g.linear_b), e.remove(g.linear_b); }},
      {"a factor on a variable that the edit removes", ErrorCode::stale_id, "'a'",
       [](Chain& g, E& e) { e.remove(g.a), e.add(Prior{pose_at(0)}, Sigma(1), g.a); }},
      {"a value for a variable that the edit removes", ErrorCode::stale_id, "'a'",
       [](Chain& g, E& e) { e.remove(g.a), e.set(g.a, pose_at(1)); }},
      {"a value that is not finite", ErrorCode::not_finite, "set", [](Chain& g, E& e) { e.set(g.b, pose_at(kNan)); }},
      {"a new value that is not finite", ErrorCode::not_finite, "add", [](Chain&, E& e) { e.add(pose_at(kNan)); }},
      {"a NaN measurement", ErrorCode::not_finite, "between",
       [](Chain& g, E& e) { e.add(Between{pose_at(kNan)}, Sigma(1), g.a, g.b); }},
      {"an infinite measurement", ErrorCode::not_finite, "between",
       [](Chain& g, E& e) { e.add(Between{pose_at(HUGE_VAL)}, Sigma(1), g.a, g.b); }},
      {"indefinite information", ErrorCode::indefinite, "noise",
       [](Chain& g, E& e) { e.add(Prior{pose_at(0)}, Information(indefinite()), g.a); }},
      {"an indefinite covariance", ErrorCode::indefinite, "noise",
       [](Chain& g, E& e) { e.add(Prior{pose_at(0)}, Covariance(indefinite()), g.a); }},
      {"a sigma of zero", ErrorCode::indefinite, "noise",
       [](Chain& g, E& e) { e.add(Prior{pose_at(0)}, Sigma(0.0), g.a); }},
      {"a negative sigma", ErrorCode::indefinite, "noise",
       [](Chain& g, E& e) { e.add(Prior{pose_at(0)}, Sigmas(Vec6d::constant(-1.0)), g.a); }},
      {"a loss without a scale", ErrorCode::bad_input, "loss",
       [](Chain& g, E& e) { e.add(Prior{pose_at(0)}, Sigma(1), Huber(0.0), g.a); }},
      {"a linear prior with d too long", ErrorCode::size_mismatch, "6 columns",
       [](Chain& g, E& e) {
         LinearPrior p = unit_prior(g.c, pose_at(2));
         p.d.push_back(0.0);
         e.add(p);
       }},
      {"a linear prior whose parts make up for each other", ErrorCode::size_mismatch, "6 columns",
       [](Chain& g, E& e) {
         LinearPrior p = unit_prior(g.c, pose_at(2));
         p.d.push_back(0.0);
         p.R.pop_back();
         e.add(p);
       }},
      {"a linear prior of the wrong width", ErrorCode::size_mismatch, "12 columns",
       [](Chain& g, E& e) {
         LinearPrior p = unit_prior(g.c, pose_at(2));
         p.variables.push_back(g.b);
         p.estimates.insert(p.estimates.end(), p.estimates.begin(), p.estimates.end());
         e.add(p);
       }},
      {"a linear prior over nothing", ErrorCode::size_mismatch, "0 columns",
       [](Chain&, E& e) { e.add(LinearPrior{}); }},
      {"a linear prior with a NaN", ErrorCode::not_finite, "linear prior",
       [](Chain& g, E& e) {
         LinearPrior p = unit_prior(g.c, pose_at(2));
         p.R[3] = kNan;
         e.add(p);
       }},
      {"a linear prior about a point that is not finite", ErrorCode::not_finite, "estimate",
       [](Chain& g, E& e) { e.add(unit_prior(g.c, pose_at(kNan))); }},
      {"a linear prior that names a variable twice", ErrorCode::duplicate, "twice",
       [](Chain& g, E& e) {
         LinearPrior p = unit_prior(g.c, pose_at(2));
         p.variables.push_back(g.c);
         e.add(p);
       }},
      {"a linear prior over a stale id", ErrorCode::stale_id, "#3.1",
       [](Chain& g, E& e) { e.add(unit_prior(g.gone, pose_at(2))); }},
      {"another version of the graph", ErrorCode::conflict, "version",
       [](Chain& g, E& e) { e.require_version(g.graph.version() + 1); }},
  };
}

TEST(Graph, IsBitIdenticalAfterARefusedEditAndTheErrorNamesTheItem) {  // V5
  for (const Refusal& refusal : refusals()) {
    Chain g;
    const std::uint64_t before = fingerprint(g.graph), version = g.graph.version();
    GraphEdit edit = g.graph.edit();
    // Good items stand on both sides of the bad one.
    const auto y = edit.add(pose_at(5.0));
    edit.add(Between{pose_at(1.0)}, Sigma(0.1), g.c, y);
    edit.set(g.c, pose_at(2.5));
    edit.remove(g.prior_a);
    refusal.spoil(g, edit);
    edit.fix(g.b);
    edit.add(Prior{pose_at(5.0)}, Sigma(0.1), y);
    const Result<void> result = g.graph.apply(edit);
    ASSERT_FALSE(result.ok()) << refusal.name;
    EXPECT_EQ(result.error().code, refusal.code) << refusal.name << ": " << result.error().text();
    EXPECT_NE(result.error().text().find(refusal.names), std::string::npos)
        << refusal.name << ": " << result.error().text();
    EXPECT_EQ(result.error().text().find('\n'), std::string::npos) << refusal.name;
    EXPECT_EQ(fingerprint(g.graph), before) << refusal.name;
    EXPECT_EQ(g.graph.version(), version) << refusal.name;
    EXPECT_FALSE(g.graph.contains(y)) << refusal.name;
    // The same storage, cleared, is a good edit again.
    edit.clear();
    edit.add(Prior{pose_at(1.0)}, Sigma(0.1), g.b);
    EXPECT_TRUE(g.graph.apply(edit)) << refusal.name;
    EXPECT_NE(fingerprint(g.graph), before) << refusal.name;
  }
}

TEST(Graph, RefusesGivenIdsThatAreOrWereInUse) {  // V5
  // What a damaged message could hold: keys that insert would trip over.
  const auto spoil = [](const std::function<void(Chain&, GraphEdit&)>& f) {
    Chain g;
    GraphEdit edit;
    f(g, edit);
    const std::uint64_t before = fingerprint(g.graph);
    EXPECT_FALSE(g.graph.apply(edit));
    EXPECT_EQ(fingerprint(g.graph), before);
  };
  const Pose3d x = pose_at(0);
  const Prior measurement{x};
  const auto noise = Sigma(1.0);
  using Ops = FactorOps;
  const Ops* ops = &kFactorOps<Prior<Pose3d>, IsotropicNoise>;
  const auto factor = [&](GraphEdit& e, SlotKey key, SlotKey variable) {
    edit::Factors& c = e.factors(ops);
    c.added.push_back({key, 0, e.next_order(), Loss::none()});
    c.measurements.push_back(&measurement);
    c.noises.push_back(&noise);
    c.variables.push_back(variable);
  };
  const auto variable = [&](GraphEdit& e, SlotKey key) {
    e.variables(&kVariableOps<Pose3d>).add({key, 0, e.next_order(), false, false}, &x, &x);
  };
  spoil([&](Chain& g, GraphEdit& e) { factor(e, g.prior_a.key, g.a.key); });
  spoil([&](Chain& g, GraphEdit& e) { factor(e, g.gone_factor.key, g.a.key); });
  spoil([&](Chain& g, GraphEdit& e) { factor(e, {g.prior_a.key.index, 9}, g.a.key); });
  spoil([&](Chain& g, GraphEdit& e) { factor(e, {50, 0}, g.a.key); });
  spoil([&](Chain& g, GraphEdit& e) { factor(e, {50, 1}, g.a.key), factor(e, {50, 1}, g.a.key); });
  spoil([&](Chain& g, GraphEdit& e) { factor(e, {50, 1}, g.a.key), factor(e, {50, 2}, g.a.key); });
  spoil([&](Chain& g, GraphEdit& e) { factor(e, {0xfffffff0u, 1}, g.a.key); });
  spoil([&](Chain& g, GraphEdit& e) { variable(e, g.a.key); });
  spoil([&](Chain& g, GraphEdit& e) { variable(e, g.gone.key); });
  spoil([&](Chain&, GraphEdit& e) { variable(e, {50, 1}), variable(e, {50, 2}); });
  spoil([&](Chain& g, GraphEdit& e) {  // removed, but not to come back under its own or an older name
    e.variables(&kVariableOps<Pose3d>).remove(g.c.key);
    variable(e, g.c.key);
  });
  spoil([&](Chain& g, GraphEdit& e) {  // a serial that is not above those in the graph
    e.variables(&kVariableOps<Pose3d>).add({{60, 1}, 1, e.next_order(), false, false}, &x, &x);
    static_cast<void>(g);
  });
  spoil([&](Chain& g, GraphEdit& e) {  // the id of a linear prior that lives
    edit::Priors& c = e.priors();
    const LinearPrior p = unit_prior(g.c, x);
    c.variables = p.variables;
    for (const auto* v : {&p.estimates, &p.d, &p.R}) c.numbers.insert(c.numbers.end(), v->begin(), v->end());
    c.added.push_back({g.linear_b.key, 0, e.next_order(), 0, 1, 0, c.numbers.size()});
  });
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
