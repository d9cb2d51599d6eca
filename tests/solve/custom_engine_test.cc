// A user's own engine: relaxation, one variable at a time by Gauss–Newton with all others held (T. Duckett, S.
// Marsland, J. Shapiro, "Fast, On-line Learning of Globally Consistent Maps", 2002). It follows a graph, says what it
// can do, and refuses whatever else it is asked for.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "graph/random_graph.h"
#include "oriel/linear/linearize_factor.h"
#include "oriel/solve/contents_of.h"
#include "oriel/solve/defaults.h"
#include "oriel/solve/native_engine.h"

namespace {

using namespace oriel;  // NOLINT(google-build-using-namespace): as a user would write it

class Relaxation final : public Engine {
 public:
  explicit Relaxation(Graph& graph) : graph_(graph), subscription_(graph.subscribe()) {}
  ~Relaxation() override { graph_.unsubscribe(subscription_); }
  std::string_view name() const override { return "relaxation"; }
  EngineCapabilities capabilities() const noexcept override {
    return {.gauss_newton = true, .losses = true, .linear_priors = true, .incremental = true};
  }
  Result<void> sync() noexcept override {
    graph_.collect(subscription_, net_);
    if (net_.whole()) factors_.clear(), variables_.clear();  // it had fallen too far behind
    for (const auto& c : net_.factor_columns()) follow(factors_, c->ops->key, *c);
    follow(factors_, PriorTable::kKey, net_.priors());
    for (const auto& c : net_.variable_columns()) follow(variables_, c->ops->key, *c);
    return {};
  }
  double cost() noexcept override {
    double sum = sync() ? 0.0 : HUGE_VAL;
    for (const FactorId& id : factors_) sum += linearize_factor(graph_, id, false)->cost;
    return sum;
  }
  Summary solve(const SolveOptions& options) noexcept override {
    if (auto ok = can_solve(*this, graph_, options); !ok) return refused(options, ok.error());
    Summary s;
    s.method = options.method, s.reason = Reason::max_iterations, s.initial_cost = s.final_cost = cost();
    Solution before{graph_.version(), {}};
    for (const VariableKey& id : variables_) before.columns.push_back(column(id));
    const Settled open = settle(options, false, false);  // what the caller left to the engine
    for (; s.reason == Reason::max_iterations && s.iterations < open.max_iterations; ++s.iterations) {
      for (const VariableKey& id : variables_)
        if (!graph_.fixed(id) && graph_.find_ops(id.type)->dim > 0) relax(id);
      const double last = s.final_cost, bound = open.function_tolerance * last, decrease = last - cost();
      if (!(decrease > bound)) s.reason = decrease >= -bound ? Reason::function_tolerance : Reason::diverged;
      s.final_cost = last - decrease, s.reason_value = decrease, s.reason_bound = bound;
    }
    if (s.failed()) (void)graph_.adopt(before);
    return s;
  }
  Result<EngineContents> contents() noexcept override {
    return (void)sync(), contents_of(graph_, variables_, factors_);
  }

 private:
  template <class Id, class Column>
  static void follow(std::vector<Id>& held, std::uint64_t type, const Column& column) {
    for (const SlotKey k : column.removed) std::erase(held, Id{type, k});
    for (const auto& a : column.added) held.push_back(Id{type, a.key});
  }
  Solution::Column column(const VariableKey& id, const double* step = nullptr) const {
    Solution::Column c{graph_.find_ops(id.type), {id.key}, ByteColumn(graph_.find_ops(id.type)->bytes)};
    c.values.push_back(graph_.find_value(id));
    const std::int32_t offset = step == nullptr ? -1 : 0;  // negative: it stays as it is
    c.ops->plus(1, c.values.at(0), step, &offset, c.values.at(0));
    return c;
  }
  void relax(const VariableKey& id) {  // x ⊞ -(JᵀJ)⁻¹ Jᵀr
    const int dim = graph_.find_ops(id.type)->dim;
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(dim, dim), g = Eigen::MatrixXd::Zero(dim, 1);
    for (const FactorId& factor : factors_) {
      const FactorLinearization f = *linearize_factor(graph_, factor, false);
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(f.rows, dim);
      const double* columns = f.jacobian.data();
      for (const VariableKey& v : f.variables) {
        if (v == id) J += Eigen::Map<const Eigen::MatrixXd>(columns, f.rows, dim);
        columns += f.rows * graph_.find_ops(v.type)->dim;
      }
      H += J.transpose() * J;
      g += J.transpose() * Eigen::Map<const Eigen::VectorXd>(f.residual.data(), f.rows);
    }
    const Eigen::VectorXd step = -H.completeOrthogonalDecomposition().solve(g);
    (void)graph_.adopt({graph_.version(), {column(id, step.data())}});
  }

  Graph& graph_;
  Subscription subscription_;
  GraphEdit net_;
  std::vector<VariableKey> variables_;
  std::vector<FactorId> factors_;
};

// A square that is walked twice and closed.
void walk(Graph& graph) {
  GraphEdit edit = graph.edit();
  std::vector<VariableId<Pose2d>> x;
  const Pose2d side = Pose2d{}.plus({{M_PI / 2.0, 1.0, 0.0}});
  for (int k = 0; k < 8; ++k) {
    const Pose2d off = Pose2d{}.plus({{0.1 * (k % 3 - 1), 0.05 * k, -0.1 * (k % 2)}});
    x.push_back(edit.add(k == 0 ? Pose2d{} : edit.value(x.back()) * side * off));
    if (k == 0)
      edit.add(Prior{Pose2d{}}, Sigma(0.01), x[0]);
    else
      edit.add(Between{side.plus({{0.02 * (k % 2), 0.1, 0.0}})}, Sigma(0.1), x[x.size() - 2], x.back());
    if (k >= 4) edit.add(Between{Pose2d{}}, Sigma(0.05), Huber(1.0), x[x.size() - 5], x.back());
  }
  ASSERT_TRUE(graph.apply(edit));
}

// C8
TEST(CustomEngine, FindsTheOptimumOfNativeInASmallPoseGraph) {
  Graph mine, theirs;
  walk(mine), walk(theirs);
  Relaxation engine(mine);
  const Summary a = engine.solve({.method = Method::gauss_newton, .max_iterations = 1000, .function_tolerance = 1e-13});
  const Summary b = NativeEngine(theirs).solve();
  EXPECT_TRUE(a.converged()) << a;
  EXPECT_LT(a.final_cost, 0.5 * a.initial_cost);
  EXPECT_NEAR(a.final_cost, b.final_cost, 1e-6 * b.final_cost);
  EXPECT_TRUE(check(engine, mine));
}

// C7
TEST(CustomEngine, HoldsWhatItsGraphHoldsAfterEachOfManyEdits) {
  testing_graph::RandomGraph random(4);
  Relaxation engine(random.graph);
  for (int round = 0; round < 100; ++round) {
    ASSERT_TRUE(random.step(6));
    const auto ok = check(engine, random.graph);
    ASSERT_TRUE(ok) << "round " << round << ": " << ok.error();
  }
}

TEST(CustomEngine, RefusesWhatItCannotDo) {
  Graph graph;
  walk(graph);
  Relaxation engine(graph);
  EXPECT_EQ(engine.solve({}).reason_text(), "the engine relaxation has no Levenberg-Marquardt");
  EXPECT_EQ(engine.joint_covariance(std::span<const VariableKey>()).error().text(),
            "the engine relaxation has no covariances");
}

}  // namespace
