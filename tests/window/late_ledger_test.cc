// Late data against the batch: whatever comes late, live states have the Gaussian that they would have had in time.
#include "oriel/window/late_ledger.h"

#include <gtest/gtest.h>

#include <numeric>

#include "oriel/solve/native_engine.h"
#include "oriel/testing/allocation_counter.h"
#include "window/marginal_problems.h"

namespace oriel {
namespace {

using dense_oracle::VectorXd;
using namespace marginal_problems;

// Where the least squares of a system put a variable: its value and the step from there. Vectors alone.
VectorXd mean(const Graph& graph, const System& s, const VectorXd& step, VariableKey id) {
  const VariableOps& ops = *graph.find_ops(id.type);
  const std::vector<double> zero(ops.bytes / sizeof(double), 0.0);
  VectorXd m(ops.dim);
  ops.minus(graph.find_value(id), zero.data(), m.data());
  return m + step.segment(s.offsets[s.find(id)], ops.dim);
}

// Means and covariances of all that lives in `few` are those of the same variables in `all`.
void expect_gaussian_of(const Graph& all_graph, const Graph& few_graph, double tolerance) {
  const System all = dense_oracle::system(all_graph), few = dense_oracle::system(few_graph);
  const MatrixXd all_cov = all.H.inverse(), few_cov = few.H.inverse();
  const VectorXd all_step = -all_cov * all.g, few_step = -few_cov * few.g;
  const std::vector<int> same = all.scalars(few.variables);
  EXPECT_LT(difference(few_cov, all_cov(same, same)), tolerance);
  for (const VariableKey& id : few.variables)
    EXPECT_LT(difference(mean(few_graph, few, few_step, id), mean(all_graph, all, all_step, id)), tolerance);
}

// The same problem twice: one whose variables leave, one that keeps all.
struct LateProblem {
  LinearProblem online, batch;
  LateLedger ledger;
  Marginalizer marginalizer;
  GraphEdit edit;
  Random random;
  SquareRootMethod method;
  int stamp = 0;

  LateProblem(unsigned seed, SquareRootMethod how, const LateLedgerOptions& options = {})
      : online(seed), batch(seed), ledger(options), edit(online.graph), random(seed + 100), method(how) {}

  bool live(int i) const { return online.graph.find_value(online.ids[i]) != nullptr; }

  void leave(const std::vector<VariableKey>& ids) {
    const auto report = marginalizer.marginalize(
        online.graph, ids, {.landmarks = LandmarkPolicy::keep, .method = method, .ledger = &ledger}, edit);
    ASSERT_TRUE(report.ok()) << report.error();
    apply();
  }
  void apply() {
    const auto ok = online.graph.apply(edit);
    ASSERT_TRUE(ok.ok()) << ok.error();
    ledger.commit(Time{++stamp});
    edit.clear();
  }
  // A factor that both get: the batch at once, the window as late as it is.
  template <class R, class Noise, class... V>
  LateOutcome add(const R& residual, const Noise& noise, VariableId<V>... ids) {
    GraphEdit direct = batch.graph.edit();
    direct.add(residual, noise, ids...);
    EXPECT_TRUE(batch.graph.apply(direct).ok());
    edit.clear();
    const auto factor = detach(residual, noise, ids...);
    const LateOutcome outcome = ledger.fold(online.graph, factor.view(), edit);
    if (outcome == LateOutcome::live) edit.add(residual, noise, ids...);
    apply();
    return outcome;
  }
  LateOutcome add_pair(int black, int white) {
    LateOutcome outcome = LateOutcome::removed;
    online.with_pair(
        online.ids[black], online.ids[white],
        [&](const auto& residual, const auto& noise, auto x, auto y) { outcome = add(residual, noise, x, y); });
    return outcome;
  }
  // A pair of fields of different colours.
  std::pair<int, int> pick() {
    const int n = static_cast<int>(online.ids.size());
    for (;;) {
      const int i = static_cast<int>(random.uniform(0.0, n - 1e-9)),
                j = static_cast<int>(random.uniform(0.0, n - 1e-9));
      if (!LinearProblem::is_white(i, 4) && LinearProblem::is_white(j, 4)) return {i, j};
    }
  }
  // What a live variable's own prior says is absorbed: it changes nothing but where it stands.
  void absorb_prior_of(int i) {
    std::vector<FactorId> own;
    online.graph.for_each_factor(online.ids[i], [&](std::uint32_t table, std::uint32_t row) {
      if (table == Graph::kPriorTable || online.graph.tables()[table]->arity() > 1) return;
      own.push_back({online.graph.tables()[table]->ops().key, online.graph.tables()[table]->slots().key(row)});
    });
    const auto report = marginalizer.absorb(online.graph, own, {.method = method}, edit);
    ASSERT_TRUE(report.ok()) << report.error();
    apply();
  }
  // Those that are asked for; landmarks that only they see go with them, without a place in the ledger.
  bool in_reach(int i) const { return live(i) || ledger.holds(online.ids[i]); }
};

// W7
TEST(LateLedger, LateFactorsInAnyOrderEndAtTheGaussianOfTheBatch) {
  int folded = 0;
  for (unsigned seed = 1; seed <= 120; ++seed) {
    LateProblem p(seed, seed % 2 == 0 ? SquareRootMethod::qr : SquareRootMethod::schur);
    std::vector<int> order(16);
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), std::mt19937(seed));
    NativeEngine engine(p.online.graph);
    for (int k = 0; k < 12; ++k) {
      std::vector<VariableKey> ids;
      for (int i = 0; i < (k % 4 == 1 ? 2 : 1); ++i)
        if (p.live(order[k + i])) ids.push_back(p.online.ids[order[k + i]]);
      if (!ids.empty()) p.leave(ids);
      if (seed % 5 == 1 && p.live(order[15])) p.absorb_prior_of(order[15]);
      if (seed % 7 == 0) {
        ASSERT_FALSE(engine.solve({.max_iterations = 2}).failed());
      }
      for (int late = 0; late < static_cast<int>(seed % 3); ++late) {
        const auto [i, j] = p.pick();
        if (!p.in_reach(i) || !p.in_reach(j)) continue;
        const LateOutcome outcome = p.add_pair(i, j);
        const bool both_live = p.live(i) && p.live(j);
        EXPECT_EQ(outcome, both_live ? LateOutcome::live : LateOutcome::folded);
        folded += outcome == LateOutcome::folded;
      }
    }
    SCOPED_TRACE(seed);
    expect_gaussian_of(p.batch.graph, p.online.graph, 1e-9);
  }
  EXPECT_GT(folded, 400);
}

}  // namespace
}  // namespace oriel
