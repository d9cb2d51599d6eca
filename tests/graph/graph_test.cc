// The graph as a whole: random edits against a model, and priors that lose variables.
#include "oriel/graph/graph.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <map>
#include <random>
#include <set>

#include "oriel/graph/fingerprint.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"

namespace oriel {
namespace {

using V1 = VectorNd<1>;
using V2 = VectorNd<2>;

struct Tie {  // a factor between two types, once each
  static constexpr std::string_view kName = "test.tie/1";
  using Variables = Types<V1, V2>;
  double m = 0.0;
  template <class S>
  S operator()(const VectorN<S, 1>& x, const VectorN<S, 2>& y) const {
    return x.v[0] - y.v[0] * y.v[1] - S(m);
  }
};

// ---- random edits against a model ----

class Model {
 public:
  explicit Model(unsigned seed) : random_(seed) {}

  void step() {
    GraphEdit edit = graph_.edit();
    adding_.clear();
    int adds = pick(6), links = pick(8), removes = pick(5);
    const bool refused = pick(6) == 0 && !ids_.empty();
    std::map<std::uint64_t, double> values = values_;
    auto factors = factors_;
    auto ids = ids_;
    for (; adds > 0; --adds) {
      const double x = pick(1000);
      V1 v;
      v.v[0] = x;
      const auto id = edit.add(v);
      ids.push_back(id);
      values[code(id.key)] = x;
    }
    for (; removes > 0 && ids_.size() > 3; --removes) {
      const auto id = ids_[static_cast<std::size_t>(pick(static_cast<int>(ids_.size())))];
      if (std::find(ids.begin(), ids.end(), id) == ids.end()) continue;
      edit.remove(id);
      ids.erase(std::find(ids.begin(), ids.end(), id));
      values.erase(code(id.key));
      std::erase_if(factors, [&](const auto& f) { return f.second.count(code(id.key)) > 0; });
    }
    for (; links > 0 && ids.size() > 1; --links) {
      const auto a = any(ids), b = any(ids);
      const FactorId f = edit.add(Between{V1{}}, Sigma(1), a, b);  // also of a variable with itself
      factors[code(f.key)] = {code(a.key), code(b.key)};
    }
    if (refused) edit.add(Prior{V1{}}, Sigma(0.0), ids.front());
    const std::uint64_t before = fingerprint(graph_);
    ASSERT_EQ(graph_.apply(edit).ok(), !refused);
    if (refused) {
      ASSERT_EQ(fingerprint(graph_), before);
      return edit.clear();
    }
    for (const auto id : ids_)
      if (std::find(ids.begin(), ids.end(), id) == ids.end()) dead_.push_back(id);
    ids_ = ids, values_ = values, factors_ = factors;
  }

  void check() const {
    ASSERT_EQ(graph_.variable_count(), values_.size());
    ASSERT_EQ(graph_.factor_count(), factors_.size());
    std::vector<std::uint64_t> walked, expected;
    graph_.for_each<V1>([&](auto id, const V1& v) {
      walked.push_back(code(id.key));
      EXPECT_EQ(v.v[0], values_.at(code(id.key)));
    });
    for (const auto id : ids_) expected.push_back(code(id.key));
    ASSERT_EQ(walked, expected);  // in the order in which they came
    for (const auto id : dead_) ASSERT_FALSE(graph_.contains(id));
    for (const auto id : ids_) {
      std::multiset<std::uint64_t> at, model;
      graph_.for_each_factor(id, [&](auto table, auto row) {
        const FactorTable& t = *graph_.tables()[table];
        at.insert(code(t.slots().key(row)));
        bool names_it = false;
        for (const VariableRef& ref : t.variables(row)) names_it = names_it || ref.slot == id.key.index;
        EXPECT_TRUE(names_it);
      });
      for (const auto& [f, ends] : factors_)
        for (std::size_t n = ends.count(code(id.key)); n > 0; --n) model.insert(f);
      ASSERT_EQ(at, model);
    }
    for (const auto& p : graph_.pools()) ASSERT_LE((p->extent() - p->slots().size()) * 4, p->extent());
  }

 private:
  static std::uint64_t code(SlotKey k) { return std::uint64_t{k.index} << 32 | k.generation; }
  int pick(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }
  VariableId<V1> any(const std::vector<VariableId<V1>>& ids) {
    return ids[static_cast<std::size_t>(pick(static_cast<int>(ids.size())))];
  }

  Graph graph_;
  std::mt19937 random_;
  std::vector<VariableId<V1>> ids_, dead_, adding_;
  std::map<std::uint64_t, double> values_;
  std::map<std::uint64_t, std::multiset<std::uint64_t>> factors_;
};

TEST(Graph, KeepsUpWithAModelUnderRandomEditsOfWhichSomeAreRefused) {  // V1, V2, V5, V6
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Model model(seed);
    for (int i = 0; i < 300; ++i) {
      ASSERT_NO_FATAL_FAILURE(model.step());
      if (i % 10 == 0) {
        ASSERT_NO_FATAL_FAILURE(model.check());
      }
    }
  }
}

// ---- linear priors ----

// d + R (x ⊟ 0) over scalars and pairs in a row, dense.
LinearPrior random_prior(const std::vector<VariableKey>& ids, int cols, int rows, std::mt19937& random) {
  std::normal_distribution<double> normal;
  LinearPrior p;
  p.variables = ids;
  p.estimates.assign(static_cast<std::size_t>(cols), 0.0);
  p.rows = rows, p.cols = cols;
  for (int i = 0; i < rows; ++i) p.d.push_back(normal(random));
  for (int i = 0; i < rows * cols; ++i) p.R.push_back(normal(random));
  return p;
}
Eigen::MatrixXd matrix(const LinearPriorView& p) { return Eigen::Map<const Eigen::MatrixXd>(p.R, p.rows, p.cols); }
Eigen::VectorXd vector(const LinearPriorView& p) { return Eigen::Map<const Eigen::VectorXd>(p.d, p.rows); }

struct Information {
  Eigen::MatrixXd h;
  Eigen::VectorXd g;
  explicit Information(const LinearPriorView& p)
      : h(matrix(p).transpose() * matrix(p)), g(matrix(p).transpose() * vector(p)) {}
};

TEST(Graph, MarginalizesALeavingVariableOutOfALinearPriorAndKeepsTheRest) {  // V6
  std::mt19937 random(11);
  for (const int rows : {4, 5, 9}) {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto a = edit.add(V1{});
    const auto b = edit.add(V2{});
    const auto c = edit.add(V2{});
    const FactorId id = edit.add(random_prior({a, b, c}, 5, rows, random));
    const FactorId other = edit.add(random_prior({c}, 2, 2, random));
    ASSERT_TRUE(graph.apply(edit));
    const Information before(graph.priors().numbers(graph.priors().slots().find(id.key)));
    GraphEdit removal = graph.edit();
    removal.remove(b);
    ASSERT_TRUE(graph.apply(removal));
    EXPECT_FALSE(graph.contains(id));
    EXPECT_TRUE(graph.contains(other));
    ASSERT_EQ(graph.factor_count(), 2u);
    std::uint32_t row = 0;
    graph.for_each_factor(a, [&](auto, auto r) { row = r; });
    const Information after(graph.priors().numbers(row));
    ASSERT_EQ(after.h.rows(), 3);
    const std::vector<int> keep = {0, 3, 4}, drop = {1, 2};
    const Eigen::MatrixXd hkd = before.h(keep, drop), inverse = before.h(drop, drop).eval().inverse();
    const Eigen::MatrixXd h = before.h(keep, keep) - hkd * inverse * hkd.transpose();
    const Eigen::VectorXd g = before.g(keep) - hkd * inverse * before.g(drop);
    EXPECT_LE((after.h - h).norm(), 1e-9 * before.h.norm()) << rows;
    EXPECT_LE((after.g - g).norm(), 1e-9 * before.h.norm()) << rows;
  }
}

// a is tied to b alone: when b has left, the prior says nothing of a any more, and a left in it would tie what leaves
// together with a later on.
TEST(Graph, TakesWhatAPriorKnowsNothingOfAnyMoreOutOfIt) {  // V6, M11
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(V1{});
  const auto b = edit.add(V1{});
  const auto c = edit.add(V1{});
  LinearPrior prior;
  prior.variables = {a, b, c};
  prior.estimates = {0.25, 0.5, 0.75};
  prior.rows = 2, prior.cols = 3;
  prior.R = {0.3, 0.0, -0.3, 0.7, 0.0, 0.9};  // rows: a - b, and b and c, both of no round numbers
  prior.d = {1.0, 2.0};
  edit.add(prior);
  ASSERT_TRUE(graph.apply(edit));
  GraphEdit removal = graph.edit();
  removal.remove(b);
  removal.remove(c);
  ASSERT_TRUE(graph.apply(removal));
  EXPECT_EQ(graph.factor_count(), 0u) << "no row is left that says anything of a";

  edit = graph.edit();
  const auto d = edit.add(V1{}), e = edit.add(V1{}), f = edit.add(V1{});
  prior.variables = {d, e, f};
  prior.R = {0.3, 0.0, -0.3, 0.0, 0.0, 0.9};  // d - e, and f
  edit.add(prior);
  ASSERT_TRUE(graph.apply(edit));
  GraphEdit again = graph.edit();
  again.remove(e);
  ASSERT_TRUE(graph.apply(again));
  ASSERT_EQ(graph.factor_count(), 1u);
  int of_d = 0, of_f = 0;
  graph.for_each_factor(d, [&](auto, auto) { ++of_d; });
  graph.for_each_factor(f, [&](auto, auto) { ++of_f; });
  EXPECT_EQ(of_d, 0);
  EXPECT_EQ(of_f, 1);
}

TEST(Graph, KeepsNumbersAndFirstEstimatesOfPriorsThroughCompaction) {  // V6
  std::mt19937 random(5);
  Graph graph;
  std::vector<VariableId<V2>> ids;
  std::vector<FactorId> priors;
  std::vector<std::vector<double>> blocks;
  GraphEdit edit = graph.edit();
  for (int i = 0; i < 40; ++i) {
    ids.push_back(edit.add(V2{{{double(i), 0.0}}}));
    LinearPrior p = random_prior({ids.back()}, 2, 1 + i % 3, random);
    p.estimates = {i + 0.5, -1.0 * i};
    priors.push_back(edit.add(p));
  }
  ASSERT_TRUE(graph.apply(edit));
  for (const FactorId p : priors) {
    const auto block = graph.priors().block(graph.priors().slots().find(p.key));
    blocks.emplace_back(block.begin(), block.end());
  }
  GraphEdit removal = graph.edit();
  for (int i = 0; i < 40; ++i)
    if (i % 3 != 1) removal.remove(ids[static_cast<std::size_t>(i)]);
  ASSERT_TRUE(graph.apply(removal));
  EXPECT_EQ(graph.priors().extent(), 13u);  // no holes are left
  for (std::size_t i = 1; i < 40; i += 3) {
    const std::uint32_t row = graph.priors().slots().find(priors[i].key);
    const auto block = graph.priors().block(row);
    EXPECT_EQ(std::vector<double>(block.begin(), block.end()), blocks[i]);
    const VariablePool& pool = *graph.pools()[0];
    const std::uint32_t d = pool.slots().find(ids[i].key);
    ASSERT_TRUE(pool.has_first_estimate(d));
    EXPECT_EQ(static_cast<const V2*>(pool.first_estimate(d))->v[0], static_cast<double>(i) + 0.5);
    EXPECT_EQ(graph.value(ids[i]).v[0], static_cast<double>(i));
    std::uint32_t found = 0;
    graph.for_each_factor(ids[i], [&](auto, auto r) { found = r; });
    EXPECT_EQ(found, row);
  }
  EXPECT_EQ(graph.pools()[0]->first_estimate_count(), 13u);
}

TEST(Graph, KeepsTheFirstFirstEstimateWhenASecondPriorTouchesAVariable) {
  std::mt19937 random(5);
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(V1{});
  LinearPrior p = random_prior({x}, 1, 1, random);
  p.estimates = {2.0};
  edit.add(p);
  ASSERT_TRUE(graph.apply(edit));
  GraphEdit second = graph.edit();
  p.estimates = {3.0};
  second.add(p);
  ASSERT_TRUE(graph.apply(second));
  const VariablePool& pool = *graph.pools()[0];
  EXPECT_EQ(static_cast<const V1*>(pool.first_estimate(0))->v[0], 2.0);
}

TEST(Graph, NeverTouchesAbsorbedInformationWhenAUserPriorChanges) {  // V7
  std::mt19937 random(2);
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(V1{});
  const FactorId user = edit.add(Prior{V1{}}, Sigma(1), x);
  const FactorId absorbed = edit.add(random_prior({x}, 1, 1, random));
  ASSERT_TRUE(graph.apply(edit));
  const auto numbers = [&] {
    const auto b = graph.priors().block(graph.priors().slots().find(absorbed.key));
    return std::vector<double>(b.begin(), b.end());
  };
  const auto before = numbers();
  GraphEdit change = graph.edit();
  change.remove(user);
  change.add(Prior{V1{{{5.0}}}}, Sigma(0.1), x);
  change.set(x, V1{{{4.0}}});
  ASSERT_TRUE(graph.apply(change));
  EXPECT_TRUE(graph.contains(absorbed));
  EXPECT_EQ(numbers(), before);
  EXPECT_EQ(graph.factor_count(), 2u);
}

TEST(Graph, LendsFreshIdsAfterItFollowedAnotherGraph) {  // V2
  // A follower's storage for net edits may well be one that it lent itself: clearing it must not spoil its ids.
  Graph origin, follower;
  const Subscription s = origin.subscribe();
  GraphEdit net = follower.edit();
  std::mt19937 random(9);
  std::vector<VariableId<V1>> ids;
  for (int round = 0; round < 200; ++round) {
    GraphEdit edit = origin.edit();
    for (int k = 0; k < 3; ++k) ids.push_back(edit.add(V1{}));
    if (ids.size() > 10)
      for (int k = 0; k < 3; ++k) {
        const auto at = ids.begin() + static_cast<std::ptrdiff_t>(random() % (ids.size() - 3));
        edit.remove(*at);
        ids.erase(at);
      }
    ASSERT_TRUE(origin.apply(edit));
    origin.collect(s, net);
    if (round % 7 == 3) {
      origin.collect(s, net);  // cleared before it was applied: then the whole graph is asked for again
      Graph fresh;
      const Subscription again = origin.subscribe();
      GraphEdit whole = fresh.edit();
      origin.collect(again, whole);
      ASSERT_TRUE(fresh.apply(whole));
      origin.unsubscribe(again);
      follower = std::move(fresh);
      net = follower.edit();
      continue;
    }
    ASSERT_TRUE(follower.apply(net)) << round;
    ASSERT_EQ(fingerprint(follower), fingerprint(origin));
  }
  GraphEdit own = follower.edit();
  std::set<std::uint64_t> seen;
  for (const auto id : ids) seen.insert(std::uint64_t{id.key.index} << 32 | id.key.generation);
  for (int k = 0; k < 100; ++k) {
    const auto id = own.add(V1{});
    EXPECT_TRUE(seen.insert(std::uint64_t{id.key.index} << 32 | id.key.generation).second);
  }
  EXPECT_TRUE(follower.apply(own));
}

TEST(Graph, CountsAndFindsTypesApart) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(V1{});
  const auto y = edit.add(V2{});
  const FactorId tie = edit.add(Tie{1.0}, Sigma(1), x, y);
  ASSERT_TRUE(graph.apply(edit));
  EXPECT_EQ(graph.count<V1>(), 1u);
  EXPECT_EQ(graph.count<V2>(), 1u);
  EXPECT_EQ(graph.count<VectorNd<3>>(), 0u);
  EXPECT_TRUE(graph.contains(tie));
  // The same numbers under another type name nothing.
  EXPECT_FALSE(graph.contains(VariableId<VectorNd<3>>{x.key}));
  EXPECT_EQ(graph.find(VariableId<VectorNd<3>>{x.key}), nullptr);
}

}  // namespace
}  // namespace oriel
