// Marginalization: variables leave the graph, and what their factors said about the rest stays as a Gaussian prior.
//
//   Marginalizer marginalizer;                                   // a workspace: keep it
//   GraphEdit edit = graph.edit();
//   if (auto done = marginalizer.marginalize(graph, leaving, {}, edit)) (void)graph.apply(edit);
//
// All factors at the leaving variables are linearized at the graph's values, where the last solve left them:
//   r(x) ≈ r(x0) + J (x ⊟ x0),  J at first estimates where there are any (decision 9), scaled by √ρ'.
// Eliminating the leaving columns by orthogonal transformations, or by the Schur complement, leaves
//   r = d0 + R (x ⊟ x0)  over the variables that stay, without loss for the linearized problem.
// The prior is written about x̂, the first estimate of each variable or x0 where it has none:
//   x ⊟ x0 = (x ⊟ x̂) - (x0 ⊟ x̂),  so  d = d0 - R (x0 ⊟ x̂):
// exact for vectors and where x̂ = x0; else of first order, but at x = x0 the prior's residual is d0 on every manifold.
// An old prior that is absorbed keeps its own R: it is r(x0) + R (x ⊟ x0) with r(x0) = d + R (x0 ⊟ x̂).
#pragma once
#include <span>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/linear/aligned_buffer.h"
#include "oriel/solve/summary.h"
#include "oriel/window/held_columns.h"
#include "oriel/window/information_sum.h"
#include "oriel/window/late_ledger.h"
#include "oriel/window/marginal_scope.h"
#include "oriel/window/stacked_rows.h"
#include "oriel/window/untie.h"

namespace oriel {

enum class SquareRootMethod { automatic, qr, schur };  // automatic: QR where it is cheap

struct MarginalizeOptions {
  LandmarkPolicy landmarks = LandmarkPolicy::close;
  bool first_estimates = true;
  // A factor whose whitened residual is longer than this is dropped and counted [sigmas], and so is one that its loss
  // gives no weight; 0: none is.
  double outlier_threshold = 0.0;
  // A leaving scalar that no factor determines: an error that names it, or what the rest says is kept without it.
  bool fail_if_undetermined = false;
  SquareRootMethod method = SquareRootMethod::automatic;
  // By type: what becomes of a variable that is asked to leave, and which of those that stay a new prior may tie to
  // others. Types that are not named are marginalized, and tied. The list is the caller's.
  std::span<const TypePolicy> types = {};
  // Is given what leaves (what was staged before is discarded), the caller's: commit it once the edit is applied.
  LateLedger* ledger = nullptr;
};

struct MarginalizeReport {
  int absorbed_factors = 0, absorbed_priors = 0;
  int dropped_invalid = 0;         // factors that are not valid at the values, or not finite
  int dropped_outliers = 0;        // above the outlier threshold
  int dropped_with_landmarks = 0;  // factors of dropped landmarks and variables
  int dropped_variables = 0;       // by Departure::drop
  int dropped_ties = 0;            // pairs of variables that a new prior would have tied, but for TypePolicy::tie
  // Landmarks that leaving and staying variables see, by policy; and those that leaving ones see alone.
  int closed_landmarks = 0, dropped_landmarks = 0, kept_landmarks = 0, leaving_landmarks = 0;
  int priors = 0, prior_rows = 0, prior_cols = 0;  // what is new
  std::vector<UndeterminedScalar> undetermined;    // leaving scalars that nothing determined
};

class Marginalizer {
 public:
  // Fills `edit` (cleared first; lent by this graph) with the removal of `leaving`, of landmarks by policy, and of the
  // priors that are absorbed, and with the new priors on the neighbours; the factors go with their variables. It names
  // the version of the graph that it saw. Fixed variables are taken as known and get no columns, and so are the held
  // directions of those that leave; those that stay are tied by all of theirs. The graph itself only lends ids. Errors:
  // stale_id, duplicate, bad_input (a constant), singular (fail_if_undetermined); then `edit` is empty.
  Result<MarginalizeReport> marginalize(Graph& graph, std::span<const VariableKey> leaving,
                                        const MarginalizeOptions& options, GraphEdit& edit);

  // The same for factors alone: they leave, all variables stay, and the linearization of each joins the prior that
  // knows all its variables, or becomes one, together with those on the same variables. A prior may be named too: it
  // joins a larger one. Nothing is tied that was not. Errors: stale_id, duplicate; then `edit` is empty.
  Result<MarginalizeReport> absorb(Graph& graph, std::span<const FactorId> factors, const MarginalizeOptions& options,
                                   GraphEdit& edit);

 private:
  // A factor to absorb, and the prior that it joins, or none.
  struct Guest {
    static constexpr std::uint32_t kNoHost = 0xffffffffu;
    std::uint32_t host = kNoHost;
    std::uint32_t first = 0, count = 0;  // in guest_variables_, sorted
    AbsorbedFactor factor;
  };
  Result<void> invite(const Graph& graph, std::span<const FactorId> factors);
  std::uint32_t find_host(const Graph& graph, const Guest& guest) const;
  std::span<const std::uint64_t> variables_of(const Guest& guest) const {
    return {guest_variables_.data() + guest.first, guest.count};
  }
  bool choose_qr(const Graph& graph, const MarginalComponent& component, const MarginalizeOptions& options);
  void absorb(const Graph& graph, const MarginalComponent& component, const MarginalizeOptions& options,
              MarginalizeReport& report);
  void evaluate(const Graph& graph, std::span<const MarginalRow> rows, const MarginalizeOptions& options,
                MarginalizeReport& report);
  void judge(const FactorTable& table, Batch& batch, const MarginalizeOptions& options, MarginalizeReport& report);
  void absorb_prior(const Graph& graph, const MarginalPrior& prior, MarginalizeReport& report);
  void add(const AbsorbedPrior& prior);
  void write_priors(const Graph& graph, const MarginalComponent& component, const MarginalizeOptions& options,
                    GraphEdit& edit, MarginalizeReport& report);
  bool mark_untied(const MarginalComponent& component, std::span<const TypePolicy> types, MarginalizeReport& report);
  void write_prior(const Graph& graph, const MarginalComponent& component, const SquareRootRows& root,
                   bool first_estimates, GraphEdit& edit, MarginalizeReport& report);
  bool shift(const Graph& graph, const MarginalVariable& variable, bool first_estimates);

  MarginalScope scope_;
  HeldColumns held_;
  InformationSum sum_;
  StackedRows stack_;
  bool use_qr_ = false;
  int stacked_rows_ = 0;
  SquareRootRows root_, part_;
  PriorMarginal marginal_;
  std::vector<char> tied_, own_;
  LinearPrior prior_;
  AlignedBuffer r_, j_;
  AbsorbedBatch batch_;
  std::vector<std::uint32_t> table_rows_;
  std::vector<double> error_, residual_, restricted_;
  std::vector<std::int32_t> targets_;
  std::vector<Guest> guests_;
  std::vector<std::uint64_t> guest_variables_;
  std::vector<AbsorbedFactor> group_;
};

}  // namespace oriel
