// Consistency: is an estimator as wrong as it says? The normalized estimation error squared of one estimate is
// ε = eᵀ P⁻¹ e, with its error e in the tangent space of its covariance P; if P is right, ε is χ² with as many degrees
// of freedom as e has scalars (Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation",
// 2001, section 5.4.2).
#pragma once
#include <span>
#include <string>
#include <vector>

#include "oriel/base/matrix.h"
#include "oriel/base/result.h"

namespace oriel {

// eᵀ P⁻¹ e by a Cholesky factorization; P is n × n, its lower half is used. Error: not finite, or P is not positive
// definite.
Result<double> normalized_error_squared(std::span<const double> error, std::span<const double> covariance);

struct Bounds {
  double low = 0.0, high = 0.0;
};
// The quantile of χ² with k degrees of freedom that a standard normal variable's z corresponds to, by Wilson and
// Hilferty's formula ("The distribution of chi-square", 1931): k (1 - 2/(9k) + z √(2/(9k)))³. For k ≥ 30 and |z| < 3 it
// is right to 0.1 %.
double chi_squared_quantile(double k, double z);
// Where the average of `runs` independent ε of `dof` scalars each lies with probability 0.95: runs · mean is χ² with
// runs · dof degrees of freedom.
Bounds nees_interval(int dof, std::size_t runs);

// The ε of one quantity over epochs and runs.
class NeesTable {
 public:
  NeesTable(std::string name, int dof, std::size_t epochs) : name_(std::move(name)), dof_(dof), epochs_(epochs) {}
  void add(std::size_t epoch, double value) { epochs_[epoch].push_back(value); }

  const std::string& name() const { return name_; }
  int dof() const { return dof_; }
  std::size_t epochs() const { return epochs_.size(); }
  std::size_t runs(std::size_t epoch) const { return epochs_[epoch].size(); }
  double mean(std::size_t epoch) const;  // over the runs; NaN where there is none
  double mean() const;                   // over all
  // Is the last epoch's mean inside its interval?
  bool consistent_at_end() const;

 private:
  std::string name_;
  int dof_;
  std::vector<std::vector<double>> epochs_;
};

}  // namespace oriel
