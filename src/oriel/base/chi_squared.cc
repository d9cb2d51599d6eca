#include "oriel/base/chi_squared.h"

#include <cmath>

namespace oriel {
namespace {

constexpr int kMostTerms = 1000;

// x^a e^-x / Γ(a + 1): what both expansions have in front, but for a factor.
double front(double a, double x) { return std::exp(a * std::log(x) - x - std::lgamma(a + 1.0)); }

// P(a, x) = front Σ x^k / ((a + 1) ... (a + k)), DLMF 8.7.1; converges fast for x < a + 1.
double by_series(double a, double x) {
  double term = 1.0, sum = 1.0;
  for (int k = 1; k < kMostTerms && term > 1e-17 * sum; ++k) sum += term *= x / (a + k);
  return front(a, x) * sum;
}

// 1 - P(a, x) = a front / (x + 1 - a - 1(1 - a)/(x + 3 - a - 2(2 - a)/(x + 5 - a - ...))), DLMF 8.9.2 contracted;
// evaluated from far out inwards.
double by_fraction(double a, double x) {
  double tail = 0.0;
  for (int k = kMostTerms; k >= 1; --k) tail = k * (k - a) / (x + 2.0 * k + 1.0 - a - tail);
  return 1.0 - a * front(a, x) / (x + 1.0 - a - tail);
}

}  // namespace

double chi_squared_probability(double x, int dof) {
  const double a = 0.5 * dof, half = 0.5 * x;
  if (!(x > 0.0)) return 0.0;
  return half < a + 1.0 ? by_series(a, half) : by_fraction(a, half);
}

// Bisection: it is asked for once a dimension and a probability.
double chi_squared_threshold(double probability, int dof) {
  double low = 0.0, high = dof + 1.0;
  while (chi_squared_probability(high, dof) < probability && high < 1e6) high *= 2.0;
  for (int k = 0; k < 200 && high - low > 1e-14 * high; ++k) {
    const double middle = 0.5 * (low + high);
    (chi_squared_probability(middle, dof) < probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace oriel
