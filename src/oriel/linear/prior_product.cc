#include "oriel/linear/prior_product.h"

#include <algorithm>

#include "oriel/linear/dense_kernels.h"

namespace oriel {

// R is trapezoidal as a rule: a slice of its rows begins at the first column that is not zero from there on.
int PriorProduct::subtract(const LinearPriorView& p) {
  constexpr int kSlice = 16;
  const int ld = dense::leading_dimension(p.cols);
  rows.reserve(std::int64_t{ld} * kSlice);
  product.reserve(std::int64_t{ld} * p.cols);
  std::fill_n(product.data(), std::int64_t{ld} * p.cols, 0.0);
  int first = 0;
  for (int k0 = 0; k0 < p.rows; k0 += kSlice) {
    const int k1 = std::min(k0 + kSlice, p.rows);
    auto empty = [&](int c) {
      return std::all_of(p.R + std::int64_t{c} * p.rows + k0, p.R + std::int64_t{c + 1} * p.rows,
                         [](double x) { return x == 0.0; });
    };
    while (first < p.cols && empty(first)) ++first;
    const int from = dense::round_down_8(first);
    std::fill_n(rows.data(), std::int64_t{ld} * kSlice, 0.0);
    for (int c = from; c < p.cols; ++c)
      for (int k = k0; k < k1; ++k) rows.data()[std::int64_t{k - k0} * ld + c] = p.R[std::int64_t{c} * p.rows + k];
    if (from < p.cols)
      dense::syrk_lower_minus(product.data() + from + std::int64_t{from} * ld, ld, p.cols - from, rows.data() + from,
                              ld, k1 - k0);
  }
  return ld;
}

}  // namespace oriel
