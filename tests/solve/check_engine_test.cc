// check(engine, graph): after whatever was done to a graph, and when an engine is not what its graph says.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "graph/chain.h"
#include "graph/random_graph.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

using testing::Chain;
using testing::pose_at;
using testing_graph::RandomGraph;

// An engine that holds what it is given.
class Dummy final : public Engine {
 public:
  explicit Dummy(EngineContents contents) : contents_(std::move(contents)) {}
  std::string_view name() const override { return "dummy"; }
  EngineCapabilities capabilities() const noexcept override { return {}; }
  Result<void> sync() noexcept override { return {}; }
  Summary solve(const SolveOptions&) noexcept override { return {}; }
  double cost() noexcept override { return contents_.cost; }
  Result<EngineContents> contents() noexcept override { return contents_; }

 private:
  EngineContents contents_;
};

// C7
TEST(CheckEngine, FindsNothingAfterEachStepOfRandomEditsAndSolves) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    RandomGraph random(seed);
    NativeEngine native(random.graph), late(random.graph);
    for (int round = 0; round < 200; ++round) {
      ASSERT_TRUE(random.step(6));
      const auto ok = check(native, random.graph);
      ASSERT_TRUE(ok) << "seed " << seed << ", round " << round << ": " << ok.error();
      ASSERT_EQ((*native.contents()).residuals.size(), random.factors().size() + random.prior_count());
      if (round % 10 == 3) {
        ASSERT_FALSE(native.solve({.max_iterations = 2}).failed());
        const auto solved = check(native, random.graph);
        ASSERT_TRUE(solved) << "seed " << seed << ", round " << round << ": " << solved.error();
      }
      if (round % 37 == 5) {  // one that looks seldom, and one that forgot everything
        ASSERT_TRUE(check(late, random.graph)) << "round " << round;
        native.drop_caches();
        ASSERT_TRUE(check(native, random.graph)) << "round " << round;
      }
    }
  }
}

// C7
TEST(CheckEngine, NamesTheFirstDifference) {
  using Contents = EngineContents;
  const std::vector<std::pair<std::string, std::function<void(Contents&)>>> spoils = {
      {"lacks pose3/1", [](Contents& c) { c.parameters.pop_back(); }},
      {"twice", [](Contents& c) { c.parameters.push_back(c.parameters[1]); }},
      {"not for it to hold", [](Contents& c) { c.parameters[0].id.key.generation = 0; }},
      {"dimensions", [](Contents& c) { c.parameters[0].dim = 5; }},
      {"another value of pose3/1 'a'", [](Contents& c) { c.parameters[0].value[3] ^= std::byte{1}; }},
      {"lacks factor of", [](Contents& c) { c.residuals.erase(c.residuals.begin()); }},
      {"lacks linear prior", [](Contents& c) { c.residuals.pop_back(); }},
      {"twice", [](Contents& c) { c.residuals.push_back(c.residuals[0]); }},
      {"rows", [](Contents& c) { c.residuals[0].rows = 1; }},
      {"to other variables", [](Contents& c) { c.residuals[0].parameters.clear(); }},
      {"cost", [](Contents& c) { c.cost *= 1.001; }},
      {"cost", [](Contents& c) { c.cost = std::nan(""); }},
  };
  Chain g;
  GraphEdit move = g.graph.edit();
  move.set(g.b, pose_at(1.25));  // a cost that is not zero
  ASSERT_TRUE(g.graph.apply(move));
  Dummy same(expected_contents(g.graph));
  EXPECT_TRUE(check(same, g.graph));
  for (const auto& [text, spoil] : spoils) {
    Contents contents = expected_contents(g.graph);
    spoil(contents);
    Dummy engine(std::move(contents));
    const auto result = check(engine, g.graph);
    ASSERT_FALSE(result.ok()) << text;
    EXPECT_NE(result.error().text().find(text), std::string::npos) << text << ": " << result.error();
  }
}

// C7
TEST(CheckEngine, FindsAnEngineThatFollowsAnotherGraph) {
  Chain one, other;
  GraphEdit edit = other.graph.edit();
  edit.set(other.c, pose_at(3.0));
  ASSERT_TRUE(other.graph.apply(edit));
  NativeEngine engine(other.graph);
  EXPECT_TRUE(check(engine, other.graph));
  EXPECT_FALSE(check(engine, one.graph).ok());
}

// C7
TEST(CheckEngine, KnowsFixedVariablesAndConstantsAsSuch) {
  Chain g;
  GraphEdit edit = g.graph.edit();
  edit.fix(g.b);
  ASSERT_TRUE(g.graph.apply(edit));
  NativeEngine engine(g.graph);
  EXPECT_TRUE(check(engine, g.graph));
  EXPECT_EQ((*engine.contents()).parameters.size(), 2u);
}

// The answers of a graph to one thing done twice, by kind: variable, factor, linear prior.
struct Twice {
  std::function<void(Chain&, GraphEdit&)> once;
  const char* what;
};
ErrorCode answer(const Twice& t, bool in_one_edit) {
  Chain g;
  NativeEngine engine(g.graph);
  GraphEdit edit = g.graph.edit();
  t.once(g, edit);
  if (in_one_edit) {
    t.once(g, edit);
  } else {
    const auto first = g.graph.apply(edit);
    EXPECT_TRUE(first) << t.what << ": " << first.error();
    EXPECT_TRUE(check(engine, g.graph)) << t.what;
    edit.clear();
    t.once(g, edit);
  }
  const std::uint64_t before = fingerprint(g.graph);
  const auto second = g.graph.apply(edit);
  EXPECT_FALSE(second.ok()) << t.what;
  EXPECT_EQ(fingerprint(g.graph), before) << t.what;
  const auto checked = check(engine, g.graph);
  EXPECT_TRUE(checked) << t.what << ": " << checked.error();
  return second.ok() ? ErrorCode::io : second.error().code;
}

// C7
TEST(CheckEngine, SeesTheSameAnswerForVariablesFactorsAndPriorsThatAreRemovedTwice) {
  const Twice kinds[] = {
      {[](Chain& g, GraphEdit& e) { e.remove(g.c); }, "variable"},
      {[](Chain& g, GraphEdit& e) { e.remove(g.between_ab); }, "factor"},
      {[](Chain& g, GraphEdit& e) { e.remove(g.linear_b); }, "linear prior"},
  };
  for (const Twice& t : kinds) {
    EXPECT_EQ(answer(t, true), ErrorCode::duplicate) << t.what;
    EXPECT_EQ(answer(t, false), ErrorCode::stale_id) << t.what;
  }
}

// C7
TEST(CheckEngine, SeesTheSameAnswerForVariablesFactorsAndPriorsThatAreAddedTwice) {
  const Pose3d x = pose_at(4.0);
  const Prior measurement{x};
  const auto noise = Sigma(1.0);
  const Twice kinds[] = {
      {[&](Chain&, GraphEdit& e) {
         e.variables(&kVariableOps<Pose3d>).add({{20, 1}, 0, e.next_order(), false, false}, &x, &x);
       },
       "variable"},
      {[&](Chain& g, GraphEdit& e) {
         edit::Factors& c = e.factors(&kFactorOps<Prior<Pose3d>, IsotropicNoise>);
         c.added.push_back({{20, 1}, 0, e.next_order(), Loss::none()});
         c.measurements.push_back(&measurement);
         c.noises.push_back(&noise);
         c.variables.push_back(g.a.key);
       },
       "factor"},
      {[&](Chain& g, GraphEdit& e) {
         const LinearPrior p = testing::unit_prior(g.c, x);
         edit::Priors& c = e.priors();
         const auto variables = static_cast<std::uint32_t>(c.variables.size());
         const std::size_t block = c.numbers.size();
         c.variables.push_back(g.c);
         for (const auto* v : {&p.estimates, &p.d, &p.R}) c.numbers.insert(c.numbers.end(), v->begin(), v->end());
         c.added.push_back({{20, 1}, 0, e.next_order(), variables, 1, block, c.numbers.size() - block});
       },
       "linear prior"},
  };
  for (const Twice& t : kinds) {
    EXPECT_EQ(answer(t, true), ErrorCode::duplicate) << t.what;
    EXPECT_EQ(answer(t, false), ErrorCode::duplicate) << t.what;
  }
}

}  // namespace
}  // namespace oriel
