// One factor, one prior, one manifold, one loss, each as Ceres wants it. Jacobians are by the tangent space, filled up
// with zero columns to the size of a value: PlusJacobian is [I; 0], so that their product is the tangent Jacobian
// again.
#pragma once
#include <ceres/ceres.h>

#include <memory>
#include <vector>

#include "oriel/graph/graph.h"

namespace oriel::ceres_detail {

// Doubles of a value as a parameter block; at least as many as its tangent has, for [I; 0] to exist.
inline int block_size(const VariableOps& ops) { return std::max(static_cast<int>(estimate_doubles(ops)), ops.dim); }

// A variable of the graph in memory that stands still as long as it lives: the parameter block of what has a tangent,
// and what cost functions read of constants and of first estimates.
struct HeldVariable {
  const VariableOps* ops = nullptr;
  SlotKey key;
  std::uint64_t serial = 0;
  bool fixed = false, has_first_estimate = false;
  Freedom freedom{};
  std::unique_ptr<ceres::Manifold> manifold;  // where directions are held
  std::vector<double> value, first_estimate;  // block_size each
};

// A variable as cost functions see it.
struct Argument {
  const HeldVariable* variable = nullptr;
  int block = -1;  // of the cost function's parameter blocks; -1: a constant
};

// What holds for all factors in one solve.
struct Switches {
  bool first_estimates = true;  // Jacobians are taken there; before any solve as in one with no options
};

class FactorCost final : public ceres::CostFunction {
 public:
  // Copies the measurement and the noise. Arguments with the same block are one variable named twice.
  FactorCost(const FactorOps& ops, const void* measurement, const void* noise, std::vector<Argument> arguments,
             const Switches& switches);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;
  // From now on a step to where the factor is not valid is refused; a factor that is invalid already never counts.
  void freeze(bool valid) { state_ = valid ? State::active : State::excluded; }
  // Whether it is valid counts at each point for itself again.
  void thaw() { state_ = State::open; }
  bool valid_at(double const* const* parameters) const;

 private:
  enum class State { open, active, excluded };
  bool apart() const;  // Jacobians are taken elsewhere
  bool linearize(double const* const* parameters, bool jacobians, std::vector<double>& scratch, const double*& r,
                 const double*& J) const;
  void add_jacobians(const double* J, double** jacobians) const;

  const FactorOps* ops_;
  ByteColumn measurement_, noise_;  // of one
  std::vector<Argument> arguments_;
  const Switches* switches_;
  std::vector<int> columns_;  // of each argument in the Jacobian
  int cols_ = 0;
  State state_ = State::open;
};

// r = d + R (x ⊟ x̂); its Jacobian is R.
class PriorCost final : public ceres::CostFunction {
 public:
  // `block` as PriorTable lays it out: x̂, d, R; it is copied.
  PriorCost(std::span<const double> block, std::vector<Argument> arguments);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  std::vector<double> block_;
  LinearPriorView numbers_;
  std::vector<Argument> arguments_;
  std::vector<int> columns_;
  std::vector<const double*> estimates_;
};

class PoolManifold : public ceres::Manifold {
 public:
  explicit PoolManifold(const VariableOps& ops) : ops_(&ops) {}
  int AmbientSize() const override { return block_size(*ops_); }
  int TangentSize() const override { return ops_->dim; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;

 protected:
  const VariableOps* ops_;
};

// The free directions of a variable (graph/freedom.h): with F the free rows of B at x,
//   x ⊞ δ = x ⊞ (Fᵀ δ),  y ⊟ x = F (y ⊟ x),  F Fᵀ = I.
class FreeManifold final : public PoolManifold {
 public:
  FreeManifold(const VariableOps& ops, const Freedom& freedom);
  int TangentSize() const override { return static_cast<int>(components_.size()); }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;

  const Freedom& freedom() const { return freedom_; }
  // F at x, free × dim, row by row.
  std::vector<double> directions(const double* x) const;

 private:
  Freedom freedom_;
  std::vector<int> components_;  // that are free
};

// ρ and ρ' of a Loss. ρ'' is given as 0: then Ceres scales rows by √ρ' and corrects nothing, as the native engine does.
class TableLoss final : public ceres::LossFunction {
 public:
  void set(const Loss& loss) { loss_ = loss; }
  void Evaluate(double s, double rho[3]) const override {
    const auto v = evaluate_loss(loss_, s);
    rho[0] = v.rho, rho[1] = v.weight, rho[2] = 0.0;
  }

 private:
  Loss loss_;
};

}  // namespace oriel::ceres_detail
