#include "benchmarks/support/peak.h"

#include <Eigen/Dense>
#include <algorithm>

#include "benchmarks/support/clocks.h"
#include "oriel/base/pack.h"

namespace oriel::benchmark {

double fused_multiply_add_peak() {
  using Vector = Pack::Native;
  constexpr int kChains = 12, kRounds = 200'000;  // enough to hide the latency of an FMA, few enough for 16 registers
  double best = 0.0;
  for (int attempt = 0; attempt < 5; ++attempt) {
    Vector sums[kChains];
    for (int i = 0; i < kChains; ++i) sums[i] = 1.0 + i - Vector{};
    const Vector scale = 0.999999 - Vector{}, shift = 1e-6 - Vector{};
    const double t0 = cpu_seconds();
    for (int round = 0; round < kRounds; ++round)
#pragma GCC unroll 12
      for (int i = 0; i < kChains; ++i) sums[i] = sums[i] * scale + shift;
    const double t = cpu_seconds() - t0;
    Vector sum = {};
    for (int i = 0; i < kChains; ++i) sum += sums[i];
    volatile double sink = sum[0];
    (void)sink;
    best = std::max(best, 2.0 * Pack::kNative * kChains * kRounds / t);
  }
  return best;
}

double matrix_product_rate() {
  constexpr int n = 384;
  const Eigen::MatrixXd a = Eigen::MatrixXd::Random(n, n), b = Eigen::MatrixXd::Random(n, n);
  Eigen::MatrixXd c(n, n);
  double best = 0.0;
  for (int attempt = 0; attempt < 10; ++attempt) {
    const double t0 = cpu_seconds();
    c.noalias() = a * b;
    best = std::max(best, 2.0 * n * n * n / (cpu_seconds() - t0));
  }
  return best;
}

}  // namespace oriel::benchmark
