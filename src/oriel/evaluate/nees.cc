#include "oriel/evaluate/nees.h"

#include <cmath>
#include <limits>

namespace oriel {

Result<double> normalized_error_squared(std::span<const double> error, std::span<const double> covariance) {
  const std::size_t n = error.size();
  if (covariance.size() != n * n)
    return Error{ErrorCode::size_mismatch, "NEES: expected a covariance of " + std::to_string(n) + " x " +
                                               std::to_string(n) + ", found " + std::to_string(covariance.size()) +
                                               " numbers"};
  // P = L Lᵀ row by row, and y = L⁻¹ e beside it: ε = yᵀ y.
  std::vector<double> L(n * n), y(n);
  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double s = covariance[j * n + i];
      for (std::size_t k = 0; k < j; ++k) s -= L[i * n + k] * L[j * n + k];
      if (i != j) {
        L[i * n + j] = s / L[j * n + j];
      } else if (s > 0.0 && std::isfinite(s)) {
        L[i * n + i] = std::sqrt(s);
      } else {
        return Error{ErrorCode::indefinite,
                     "NEES: the covariance is not positive definite (scalar " + std::to_string(i) + ")"};
      }
    }
    double e = error[i];
    for (std::size_t k = 0; k < i; ++k) e -= L[i * n + k] * y[k];
    y[i] = e / L[i * n + i];
    sum += y[i] * y[i];
  }
  if (!std::isfinite(sum)) return Error{ErrorCode::not_finite, "NEES: the error is not finite"};
  return sum;
}

double chi_squared_quantile(double k, double z) {
  const double v = 2.0 / (9.0 * k), root = 1.0 - v + z * std::sqrt(v);
  return k * root * root * root;
}

Bounds nees_interval(int dof, std::size_t runs) {
  constexpr double kZ = 1.959963984540054;  // of 0.975
  const auto n = static_cast<double>(runs);
  return {chi_squared_quantile(n * dof, -kZ) / n, chi_squared_quantile(n * dof, kZ) / n};
}

double NeesTable::mean(std::size_t epoch) const {
  if (epochs_[epoch].empty()) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0.0;
  for (const double v : epochs_[epoch]) sum += v;
  return sum / static_cast<double>(epochs_[epoch].size());
}

double NeesTable::mean() const {
  double sum = 0.0;
  std::size_t count = 0;
  for (const auto& epoch : epochs_)
    for (const double v : epoch) sum += v, ++count;
  return count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
}

bool NeesTable::consistent_at_end() const {
  if (epochs_.empty() || epochs_.back().empty()) return false;
  const Bounds b = nees_interval(dof_, epochs_.back().size());
  const double m = mean(epochs_.size() - 1);
  return b.low <= m && m <= b.high;
}

}  // namespace oriel
