// Judges measurements by how far they lie from what was expected: d² = rᵀ S⁻¹ r follows χ² with as many degrees of
// freedom as r has rows, where the model is right. Of whitened r with Jacobian J,
//   noise alone:      S = I, which takes the states for known: strict where they are not, and nearly free;
//   with covariance:  S = I + J P Jᵀ, P the joint covariance of the factor's variables without the factor.
// P⁺ is found with the group's factors in the graph already, each with the weight w of its loss. Of a group of one
// factor P⁺ = (P⁻¹ + w JᵀJ)⁻¹, and with M = J P⁺ Jᵀ
//   J P Jᵀ = M (I - w M)⁻¹,   S⁻¹ = (I - w M) (I + (1 - w) M)⁻¹      (Woodbury; for w = 1: S⁻¹ = I - M).
// In larger groups it takes the other factors as given. r and J are without the loss, r at the values that are there: a
// state that came between two others stands where the older one predicts it until it is solved for.
//
// A group that comes late is judged by what it says about the variables that live: rows r + J δ that are white given
// these, so that both ways are as above (with P, w = 0). If one of its factors fails it is rejected as a whole.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/solve/native_engine.h"
#include "oriel/window/factor_probe.h"
#include "oriel/window/insertion_hook.h"

namespace oriel {

struct GateOptions {
  double probability = 0.999;  // with which a measurement of the right model passes
  bool with_covariance = false;
  // A group loses the factors that fail; or all of it is rejected if one fails.
  bool rejects_group = false;
};

class MahalanobisGate final : public InsertionHook {
 public:
  // `graph` is the window's (SlidingWindow::core().followed()), and outlives the hook; it is asked for covariances
  // alone.
  explicit MahalanobisGate(Graph& graph) : engine_(graph) {}
  // For the groups of one sensor (SlidingWindow::add gives its number). Those of others pass. Refused: a probability
  // that is not between 0 and 1.
  Result<void> set(int sensor, const GateOptions& options);

  std::string_view name() const override { return "mahalanobis gate"; }
  Verdict inserted(const Graph& graph, const States& states, const InsertedGroup& group, GraphEdit& edit) override;
  Verdict late(const Graph& graph, const States& states, const LateArrival& arrival) override;
  std::int64_t dropped() const { return dropped_; }    // factors, so far; those of rejected groups not among them
  std::int64_t rejected() const { return rejected_; }  // groups
  double last_distance() const { return distance_; }   // d² of the factor that was judged last

 private:
  struct Gate {
    int sensor;
    GateOptions options;
  };
  const GateOptions* gate_of(int sensor) const;
  void take_probe(bool with_jacobian);
  void take_prior(const Graph& graph, const GraphEdit& edit, const edit::AddedPrior& prior);
  bool passes(const GateOptions& options, double weight);
  double threshold(double probability, int dof);
  double distance(bool with_covariance, double weight);
  bool find_spread();

  std::vector<Gate> gates_;
  NativeEngine engine_;
  FactorProbe probe_;
  GroupPruner pruner_;
  struct Quantile {
    double probability;
    int dof;
    double value;
  };
  std::vector<Quantile> quantiles_;
  // Of what is being judged: r, J (column-major), the variables of its columns; P, M and what is solved with it.
  std::vector<double> r_, J_, P_, M_, PJ_, A_, y_;
  std::vector<VariableKey> ids_;
  double distance_ = 0.0;
  std::int64_t dropped_ = 0, rejected_ = 0;
};

}  // namespace oriel
