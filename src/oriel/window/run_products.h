// Products of the columns of rows that touch the same variables: their part of H and g, as small dense sums.
#pragma once
#include <vector>

#include "oriel/linear/aligned_buffer.h"
#include "oriel/residual/batch.h"

namespace oriel {

class RunProducts {
 public:
  // The columns of J named, and r behind them, of lanes [begin, end): each becomes one vector without gaps, so that a
  // run of one row with many residuals takes as few operations as many rows with few.
  void pack(const Batch& batch, const std::vector<int>& columns, int begin, int end);

  // f(i, c, Σ column i · column c) for all c <= i, and f(i, count of columns, Σ column i · r).
  template <class F>
  void for_each(F&& f) {
    const int k = columns_;
    double out[2 * kTile];
    for (int i0 = 0; i0 < k; i0 += kTile) {
      const int w = k - i0 < kTile ? k - i0 : kTile;
      auto pass = [&](int c, int y) {
        multiply(i0, w, c, y, out);
        for (int n = 0; n < y; ++n)
          for (int i = c == k ? 0 : (c + n > i0 ? c + n - i0 : 0); i < w; ++i) f(i0 + i, c + n, out[n * kTile + i]);
      };
      for (int c = 0; c < i0 + w; c += 2) pass(c, c + 1 < i0 + w ? 2 : 1);
      pass(k, 1);
    }
  }

 private:
  static constexpr int kTile = 6;
  void multiply(int i0, int w, int c, int y, double* out) const;

  AlignedBuffer x_;
  int columns_ = 0, length_ = 0;
};

}  // namespace oriel
