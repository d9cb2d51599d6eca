#include "oriel/window/run_products.h"

#include <algorithm>
#include <cstring>

#include "oriel/linear/lanes.h"

namespace oriel {
namespace {

using lanes::kLanes, lanes::kNative, lanes::load_as, lanes::Native;
constexpr int kWidest = 6;

// out[n * kWidest + i] = column x + i times column y + n.
template <int W, int Y>
void products(const double* x, const double* y, int length, double* out) {
  Native s[Y][W] = {};
  for (int g = 0; g < length; g += kNative) {
    Native b[Y];
#pragma GCC unroll 2
    for (int n = 0; n < Y; ++n) b[n] = load_as<Native>(y + n * length + g);
#pragma GCC unroll 6
    for (int i = 0; i < W; ++i) {
      const Native a = load_as<Native>(x + i * length + g);
#pragma GCC unroll 2
      for (int n = 0; n < Y; ++n) s[n][i] += a * b[n];
    }
  }
#pragma GCC unroll 2
  for (int n = 0; n < Y; ++n) {
    alignas(64) double sums[8];
    lanes::store_sums<W>(s[n], sums);
    std::copy_n(sums, W, out + n * kWidest);
  }
}
using Products = void (*)(const double*, const double*, int, double*);
constexpr Products kProducts[2][kWidest] = {
    {products<1, 1>, products<2, 1>, products<3, 1>, products<4, 1>, products<5, 1>, products<6, 1>},
    {products<1, 2>, products<2, 2>, products<3, 2>, products<4, 2>, products<5, 2>, products<6, 2>}};

}  // namespace

void RunProducts::pack(const Batch& batch, const std::vector<int>& columns, int begin, int end) {
  const int lanes = end - begin, dim = batch.dim;
  columns_ = static_cast<int>(columns.size());
  length_ = (lanes * dim + kLanes - 1) / kLanes * kLanes;
  x_.reserve(static_cast<std::int64_t>(length_) * (columns_ + 1));
  double* to = x_.data();
  auto put = [&](const double* from) {
    from += begin;
    if (lanes == 1) {
      for (int r = 0; r < dim; ++r) to[r] = from[r * Batch::kRows];
    } else {
      for (int r = 0; r < dim; ++r)
        std::memcpy(to + r * lanes, from + r * Batch::kRows, sizeof(double) * static_cast<std::size_t>(lanes));
    }
    std::fill(to + lanes * dim, to + length_, 0.0);
    to += length_;
  };
  for (const int c : columns) put(batch.J + c * dim * Batch::kRows);
  put(batch.r);
}

void RunProducts::multiply(int i0, int w, int c, int y, double* out) const {
  static_assert(kTile == kWidest);
  kProducts[y - 1][w - 1](x_.data() + static_cast<std::ptrdiff_t>(i0) * length_,
                          x_.data() + static_cast<std::ptrdiff_t>(c) * length_, length_, out);
}

}  // namespace oriel
