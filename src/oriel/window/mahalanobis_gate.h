// Judges measurements by how far they lie from what was expected: d² = rᵀ S⁻¹ r follows χ² with as many degrees of
// freedom as r has rows, where the model is right. Of whitened r with Jacobian J,
//   noise alone:      S = I, which takes the states for known: strict where they are not, and nearly free;
//   with covariance:  S = I + J P Jᵀ, P the joint covariance of the factor's variables without the factor.
// P is found with the group's factors in the graph already, P⁺ = (P⁻¹ + Σ JᵀJ)⁻¹; of a group of one factor
//   S⁻¹ = I - J P⁺ Jᵀ                      (Woodbury: (I + J P Jᵀ)⁻¹ = I - J (P⁻¹ + JᵀJ)⁻¹ Jᵀ).
// In larger groups it takes the other factors as given; a robust loss stands in P⁺ with its weight and in d² without.
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
  std::int64_t dropped() const { return dropped_; }    // factors, so far; those of rejected groups not among them
  std::int64_t rejected() const { return rejected_; }  // groups
  double last_distance() const { return distance_; }   // d² of the factor that was judged last

 private:
  struct Gate {
    int sensor;
    GateOptions options;
  };
  bool passes(const GateOptions& options);
  double threshold(double probability, int dof);
  double distance(bool with_covariance);

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
  std::vector<double> b_;
  double distance_ = 0.0;
  std::int64_t dropped_ = 0, rejected_ = 0;
};

}  // namespace oriel
