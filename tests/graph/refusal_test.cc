// An edit is applied whole or not at all.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "graph/chain.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/manifold/vector.h"

namespace oriel {
namespace {

using testing::Chain;
using testing::pose_at;
using testing::unit_prior;

const double kNan = std::numeric_limits<double>::quiet_NaN();

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

struct NoDirections {  // a constant
  static constexpr std::string_view kName = "test.no_directions/1";
  static constexpr int kDim = 0;
  double x = 0.0;
};

using E = GraphEdit;

std::vector<Refusal> wrong_ids() {
  return {
      {"a stale id in a factor", ErrorCode::stale_id, "#3.1",
       [](Chain& g, E& e) { e.add(Prior{pose_at(0)}, Sigma(1), g.gone); }},
      {"an unknown id in a factor", ErrorCode::stale_id, "#77.1",
       [](Chain&, E& e) {
         e.add(Prior{pose_at(0)}, Sigma(1), VariableId<Pose3d>{{77, 1}});
       }},
      {"an id of a type without variables", ErrorCode::stale_id, "point3/1",
       [](Chain&, E& e) {
         e.add(Prior{Point3d{}}, Sigma(1), VariableId<Point3d>{{0, 1}});
       }},
      {"a removed stale id", ErrorCode::stale_id, "#3.1", [](Chain& g, E& e) { e.remove(g.gone); }},
      {"a removed id of an unknown type", ErrorCode::stale_id, "type",
       [](Chain&, E& e) {
         e.remove(VariableId<Stranger>{{0, 1}});
       }},
      {"a fixed id of an unknown type", ErrorCode::stale_id, "type",
       [](Chain&, E& e) {
         e.fix(VariableId<Stranger>{{0, 1}});
       }},
      {"a removed factor of an unknown table", ErrorCode::stale_id, "table",
       [](Chain&, E& e) {
         e.remove(FactorId{123, {0, 1}});
       }},
      {"a set stale id", ErrorCode::stale_id, "#3.1", [](Chain& g, E& e) { e.set(g.gone, pose_at(1)); }},
      {"a fixed stale id", ErrorCode::stale_id, "#3.1", [](Chain& g, E& e) { e.fix(g.gone); }},
      {"directions of a stale id", ErrorCode::stale_id, "#3.1",
       [](Chain& g, E& e) { e.set(g.gone, Freedom::position()); }},
      {"directions of a variable that the edit removes", ErrorCode::stale_id, "'a'",
       [](Chain& g, E& e) { e.remove(g.a), e.set(g.a, Freedom::position()); }},
      {"directions of an id of an unknown type", ErrorCode::stale_id, "type",
       [](Chain&, E& e) {
         e.set(VariableKey(VariableId<Stranger>{{0, 1}}), Freedom::position());
       }},
      {"a removed stale factor", ErrorCode::stale_id, "prior/1", [](Chain& g, E& e) { e.remove(g.gone_factor); }},
      {"a removed stale linear prior", ErrorCode::stale_id, "linear prior",
       [](Chain&, E& e) {
         e.remove(FactorId{PriorTable::kKey, {5, 1}});
       }},
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
  };
}

std::vector<Refusal> wrong_numbers() {
  return {
      {"another version of the graph", ErrorCode::conflict, "version",
       [](Chain& g, E& e) { e.require_version(g.graph.version() + 1); }},
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
      {"a direction that the type has not", ErrorCode::bad_input, "6 components",
       [](Chain& g, E& e) { e.set(g.b, Freedom::hold({6})); }},
      {"all directions held", ErrorCode::bad_input, "fix it",
       [](Chain& g, E& e) {
         e.set(g.b, Freedom::hold({0, 1, 2, 3, 4, 5}, Freedom::Axes::world));
       }},
      {"directions of a constant", ErrorCode::bad_input, "constant",
       [](Chain&, E& e) { e.set(e.add(NoDirections{}), Freedom::hold({0})); }},
      {"world axes of a type without", ErrorCode::bad_input, "world axes",
       [](Chain&, E& e) { e.set(e.add(ImuBiasd{}), Freedom::hold({0}, Freedom::Axes::world)); }},
      {"a new variable that comes with such", ErrorCode::bad_input, "6 components",
       [](Chain&, E& e) {
         const auto id = e.add(pose_at(1));
         e.variables(&kVariableOps<Pose3d>).added.back().freedom = Freedom::hold({7});
         static_cast<void>(id);
       }},
      {"a loss without a scale", ErrorCode::bad_input, "loss",
       [](Chain& g, E& e) { e.add(Prior{pose_at(0)}, Sigma(1), Huber(0.0), g.a); }},
  };
}

std::vector<Refusal> wrong_priors() {
  return {
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
  };
}

TEST(Graph, IsBitIdenticalAfterARefusedEditAndTheErrorNamesTheItem) {  // V5
  std::vector<Refusal> all = wrong_ids();
  for (const auto& more : {wrong_numbers(), wrong_priors()}) all.insert(all.end(), more.begin(), more.end());
  for (const Refusal& refusal : all) {
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

}  // namespace
}  // namespace oriel
