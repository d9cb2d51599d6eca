#include "oriel/engines/ceres/ceres_costs.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>

namespace oriel::ceres_detail {
namespace {

constexpr int kRows = Batch::kRows;

// Ceres lays blocks out at 8 bytes' alignment; values may want 16. A copy of one is always good.
struct AlignedValue {
  std::vector<double> memory;
  double* at = nullptr;
  explicit AlignedValue(std::size_t doubles) : memory(doubles + 2) {
    const auto address = reinterpret_cast<std::uintptr_t>(memory.data());
    at = memory.data() + (address % 16 == 0 ? 0 : 1);
  }
};

std::size_t even(std::size_t doubles) { return (doubles + 1) / 2 * 2; }

void set_block_sizes(const std::vector<Argument>& arguments, std::vector<std::int32_t>& sizes) {
  for (const Argument& a : arguments) {
    if (a.block < 0) continue;
    if (static_cast<int>(sizes.size()) <= a.block) sizes.resize(static_cast<std::size_t>(a.block) + 1);
    sizes[a.block] = block_size(*a.variable->ops);
  }
}

// Jacobians add up where a variable is named twice, so they begin at zero.
void clear_jacobians(const std::vector<std::int32_t>& sizes, int rows, double** jacobians) {
  for (std::size_t b = 0; b < sizes.size(); ++b)
    if (jacobians[b] != nullptr) std::fill_n(jacobians[b], rows * sizes[b], 0.0);
}

}  // namespace

FactorCost::FactorCost(const FactorOps& ops, const void* measurement, const void* noise,
                       std::vector<Argument> arguments, const Switches& switches)
    : ops_(&ops),
      measurement_(ops.measurement_bytes),
      noise_(ops.noise_bytes),
      arguments_(std::move(arguments)),
      switches_(&switches) {
  measurement_.push_back(measurement), noise_.push_back(noise);
  set_num_residuals(ops.dim);
  set_block_sizes(arguments_, *mutable_parameter_block_sizes());
  for (const Argument& a : arguments_) {
    columns_.push_back(cols_);
    cols_ += a.variable->ops->dim;
  }
}

bool FactorCost::apart() const {
  return switches_->first_estimates && std::any_of(arguments_.begin(), arguments_.end(),
                                                   [](const Argument& a) { return a.variable->has_first_estimate; });
}

// A batch of one row: r and J point into scratch. False where the row is not valid.
bool FactorCost::linearize(double const* const* parameters, bool jacobians, std::vector<double>& scratch,
                           const double*& r, const double*& J) const {
  std::size_t values = 0;
  for (const Argument& a : arguments_) values += even(estimate_doubles(*a.variable->ops));
  AlignedValue copies(values);
  double* copy = copies.at;
  std::vector<const void*> at(arguments_.size() * kRows), estimate(at.size());
  const bool elsewhere = jacobians && apart();
  for (std::size_t k = 0; k < arguments_.size(); ++k) {
    const HeldVariable& variable = *arguments_[k].variable;
    const void* value = variable.value.data();
    if (arguments_[k].block >= 0) {
      std::memcpy(copy, parameters[arguments_[k].block], variable.ops->bytes);
      value = copy;
      copy += even(estimate_doubles(*variable.ops));
    }
    std::fill_n(at.begin() + static_cast<std::ptrdiff_t>(k * kRows), kRows, value);
    std::fill_n(estimate.begin() + static_cast<std::ptrdiff_t>(k * kRows), kRows,
                variable.has_first_estimate ? variable.first_estimate.data() : value);
  }
  std::array<const void*, kRows> measurement, noise;
  measurement.fill(measurement_.at(0)), noise.fill(noise_.at(0));
  RowPointers rows;
  rows.rows = 1;
  rows.measurement = measurement.data(), rows.noise = noise.data();
  rows.at = at.data();
  rows.jacobian_at = elsewhere ? estimate.data() : at.data();
  scratch.resize(std::size_t{kRows} * static_cast<std::size_t>(ops_->dim) * static_cast<std::size_t>(1 + cols_) + 8);
  const auto misfit = reinterpret_cast<std::uintptr_t>(scratch.data()) % 64 / sizeof(double);
  Batch batch;
  batch.r = scratch.data() + (8 - misfit) % 8;
  batch.J = jacobians ? batch.r + kRows * ops_->dim : nullptr;
  ops_->linearize(rows, batch);
  r = batch.r, J = batch.J;
  return (batch.valid & 1) != 0;
}

bool FactorCost::valid_at(double const* const* parameters) const {
  std::vector<double> scratch;
  const double *r, *J;
  return linearize(parameters, !apart(), scratch, r, J);  // without a finite Jacobian it is not valid either
}

bool FactorCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  std::fill_n(residuals, ops_->dim, 0.0);
  if (jacobians != nullptr) clear_jacobians(parameter_block_sizes(), ops_->dim, jacobians);
  if (state_ == State::excluded) return true;
  std::vector<double> scratch;
  const double *r, *J;
  if (!linearize(parameters, jacobians != nullptr, scratch, r, J)) return state_ == State::open;
  for (int i = 0; i < ops_->dim; ++i) residuals[i] = r[i * kRows];
  if (jacobians != nullptr) add_jacobians(J, jacobians);
  return true;
}

void FactorCost::add_jacobians(const double* J, double** jacobians) const {
  for (std::size_t k = 0; k < arguments_.size(); ++k) {
    const Argument& a = arguments_[k];
    if (a.block < 0 || jacobians[a.block] == nullptr) continue;
    const int stride = block_size(*a.variable->ops), dim = a.variable->ops->dim;
    for (int c = 0; c < dim; ++c)
      for (int i = 0; i < ops_->dim; ++i)
        jacobians[a.block][i * stride + c] += J[((columns_[k] + c) * ops_->dim + i) * kRows];
  }
}

PriorCost::PriorCost(std::span<const double> block, std::vector<Argument> arguments)
    : block_(block.begin(), block.end()), arguments_(std::move(arguments)) {
  set_block_sizes(arguments_, *mutable_parameter_block_sizes());
  const double* at = block_.data();
  for (const Argument& a : arguments_) {
    columns_.push_back(numbers_.cols);
    estimates_.push_back(at);
    numbers_.cols += a.variable->ops->dim;
    at += estimate_doubles(*a.variable->ops);
  }
  const auto rest = block_.data() + block_.size() - at;  // d and R: rows (1 + cols)
  numbers_.rows = static_cast<int>(rest / (1 + numbers_.cols));
  numbers_.d = at;
  numbers_.R = at + numbers_.rows;
  set_num_residuals(numbers_.rows);
}

bool PriorCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  std::vector<double> error(static_cast<std::size_t>(numbers_.cols));
  for (std::size_t k = 0; k < arguments_.size(); ++k) {
    const Argument& a = arguments_[k];
    const VariableOps& ops = *a.variable->ops;
    AlignedValue x(estimate_doubles(ops)), origin(estimate_doubles(ops));
    std::memcpy(x.at, a.block >= 0 ? parameters[a.block] : a.variable->value.data(), ops.bytes);
    std::memcpy(origin.at, estimates_[k], ops.bytes);
    ops.minus(x.at, origin.at, error.data() + columns_[k]);
  }
  evaluate_prior(numbers_, error.data(), residuals);
  if (jacobians == nullptr) return true;
  clear_jacobians(parameter_block_sizes(), numbers_.rows, jacobians);
  for (std::size_t k = 0; k < arguments_.size(); ++k) {
    const Argument& a = arguments_[k];
    if (a.block < 0 || jacobians[a.block] == nullptr) continue;
    const int stride = block_size(*a.variable->ops), dim = a.variable->ops->dim;
    for (int c = 0; c < dim; ++c)
      for (int i = 0; i < numbers_.rows; ++i)
        jacobians[a.block][i * stride + c] +=
            numbers_.R[static_cast<std::size_t>(columns_[k] + c) * static_cast<std::size_t>(numbers_.rows) + i];
  }
  return true;
}

bool PoolManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  AlignedValue from(estimate_doubles(*ops_)), to(estimate_doubles(*ops_));
  std::memcpy(from.at, x, ops_->bytes);
  const std::int32_t offset = 0;
  ops_->plus(1, from.at, delta, &offset, to.at);
  std::copy_n(x, AmbientSize(), x_plus_delta);  // what fills the block up
  std::memcpy(x_plus_delta, to.at, ops_->bytes);
  return true;
}

bool PoolManifold::PlusJacobian(const double*, double* jacobian) const {
  std::fill_n(jacobian, AmbientSize() * TangentSize(), 0.0);
  for (int i = 0; i < TangentSize(); ++i) jacobian[i * TangentSize() + i] = 1.0;
  return true;
}

bool PoolManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  AlignedValue to(estimate_doubles(*ops_)), from(estimate_doubles(*ops_));
  std::memcpy(to.at, y, ops_->bytes);
  std::memcpy(from.at, x, ops_->bytes);
  ops_->minus(to.at, from.at, y_minus_x);
  return true;
}

bool PoolManifold::MinusJacobian(const double*, double* jacobian) const {
  std::fill_n(jacobian, AmbientSize() * TangentSize(), 0.0);
  for (int i = 0; i < TangentSize(); ++i) jacobian[i * AmbientSize() + i] = 1.0;
  return true;
}

FreeManifold::FreeManifold(const VariableOps& ops, const Freedom& freedom) : PoolManifold(ops), freedom_(freedom) {
  for (int k = 0; k < ops.dim; ++k)
    if (!freedom.holds(k)) components_.push_back(k);
}

std::vector<double> FreeManifold::directions(const double* x) const {
  const auto n = static_cast<std::size_t>(ops_->dim);
  std::vector<double> B(n * n), F;
  for (std::size_t k = 0; k < n; ++k) B[k * n + k] = 1.0;
  if (freedom_.axes == Freedom::Axes::world) {
    AlignedValue at(estimate_doubles(*ops_));
    std::memcpy(at.at, x, ops_->bytes);
    ops_->world_axes(at.at, B.data());
  }
  for (const int k : components_)
    for (std::size_t c = 0; c < n; ++c) F.push_back(B[c * n + static_cast<std::size_t>(k)]);
  return F;
}

bool FreeManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const std::vector<double> F = directions(x);
  const auto n = static_cast<std::size_t>(ops_->dim);
  std::vector<double> d(n);
  for (std::size_t i = 0; i < components_.size(); ++i)
    for (std::size_t k = 0; k < n; ++k) d[k] += F[i * n + k] * delta[i];
  return PoolManifold::Plus(x, d.data(), x_plus_delta);
}

bool FreeManifold::PlusJacobian(const double* x, double* jacobian) const {
  const std::vector<double> F = directions(x);
  const auto n = static_cast<std::size_t>(ops_->dim), free = components_.size();
  std::fill_n(jacobian, static_cast<std::size_t>(AmbientSize()) * free, 0.0);
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t i = 0; i < free; ++i) jacobian[k * free + i] = F[i * n + k];
  return true;
}

bool FreeManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  const std::vector<double> F = directions(x);
  const auto n = static_cast<std::size_t>(ops_->dim);
  std::vector<double> d(n);
  PoolManifold::Minus(y, x, d.data());
  for (std::size_t i = 0; i < components_.size(); ++i) {
    y_minus_x[i] = 0.0;
    for (std::size_t k = 0; k < n; ++k) y_minus_x[i] += F[i * n + k] * d[k];
  }
  return true;
}

bool FreeManifold::MinusJacobian(const double* x, double* jacobian) const {
  const std::vector<double> F = directions(x);
  const auto n = static_cast<std::size_t>(ops_->dim), ambient = static_cast<std::size_t>(AmbientSize());
  std::fill_n(jacobian, ambient * components_.size(), 0.0);
  for (std::size_t i = 0; i < components_.size(); ++i)
    for (std::size_t k = 0; k < n; ++k) jacobian[i * ambient + k] = F[i * n + k];
  return true;
}

}  // namespace oriel::ceres_detail
