#include "oriel/linear/accumulate_runs.h"

#include <algorithm>
#include <array>

#include "oriel/linear/kernel_dims.h"
#include "oriel/linear/lanes.h"
#include "oriel/linear/linearize.h"

namespace oriel {
namespace {

using lanes::kLanes, lanes::kStride, lanes::load, lanes::store, lanes::turn, lanes::V8;

constexpr int kRegisters = 24;  // running sums at once

// Σ over rows and lanes of A_i B_c for columns [0, N) of B: DA × N sums, column by column. `count` lanes, a multiple of
// eight; the sums over the eight lanes are made at the end, in pairs.
template <int DA, int N>
void sum_columns(const double* a, const double* b, int dim, int count, double* out) {
  constexpr int kSums = DA * N, kPadded = (kSums + 7) / 8 * 8;
  V8 s[kPadded] = {};
  for (int g = 0; g < count; g += kLanes)
    for (int r = 0; r < dim; ++r) {
      V8 x[DA];
#pragma GCC unroll 9
      for (int i = 0; i < DA; ++i) x[i] = load(a + (i * dim + r) * kStride + g);
#pragma GCC unroll 8
      for (int c = 0; c < N; ++c) {
        const V8 y = load(b + (c * dim + r) * kStride + g);
#pragma GCC unroll 9
        for (int i = 0; i < DA; ++i) s[c * DA + i] += x[i] * y;
      }
    }
#pragma GCC unroll 4
  for (int e = 0; e < kPadded; e += 8) {
    V8 t[8];
#pragma GCC unroll 8
    for (int k = 0; k < 8; ++k) t[k] = s[e + k];
    turn(t);
    store(out + e, ((t[0] + t[1]) + (t[2] + t[3])) + ((t[4] + t[5]) + (t[6] + t[7])));
  }
}

struct Product {
  double entries[kLargestKernelDim * kLargestKernelDim + 8];
};

template <int DA, int DB>
void run_kernel(const double* a, const double* b, int dim, int count, Product& out) {
  constexpr int kWide = std::min(std::max(kRegisters / DA, 1), DB), kRest = DB % kWide;
  int c = 0;
  for (; c + kWide <= DB; c += kWide) {
    double sums[(DA * kWide + 7) / 8 * 8];
    sum_columns<DA, kWide>(a, b + c * dim * kStride, dim, count, sums);
    std::copy_n(sums, DA * kWide, out.entries + c * DA);
  }
  if constexpr (kRest > 0) {
    double sums[(DA * kRest + 7) / 8 * 8];
    sum_columns<DA, kRest>(a, b + c * dim * kStride, dim, count, sums);
    std::copy_n(sums, DA * kRest, out.entries + c * DA);
  }
}

void run_fallback(int da, int db, const double* a, const double* b, int dim, int count, double* out) {
  for (int c = 0; c < db; ++c)
    for (int i = 0; i < da; ++i) {
      double sum = 0.0;
      for (int r = 0; r < dim; ++r)
        for (int l = 0; l < count; ++l) sum += a[(i * dim + r) * kStride + l] * b[(c * dim + r) * kStride + l];
      out[c * da + i] = sum;
    }
}

using Kernel = void (*)(const double*, const double*, int, int, Product&);
template <int DA>
constexpr std::array<Kernel, kKernelDims> kernels_of() {
  return {&run_kernel<DA, 1>, &run_kernel<DA, 2>, &run_kernel<DA, 3>,
          &run_kernel<DA, 6>, &run_kernel<DA, 7>, &run_kernel<DA, 9>};
}
constexpr std::array<std::array<Kernel, kKernelDims>, kKernelDims> kKernels = {
    kernels_of<1>(), kernels_of<2>(), kernels_of<3>(), kernels_of<6>(), kernels_of<7>(), kernels_of<9>()};

// Columns of one variable: blocks above the diagonal are not wanted. Six columns are two threes.
void square_six(const double* a, int dim, int count, Product& out) {
  double sums[24];
  sum_columns<6, 3>(a, a, dim, count, sums);
  std::copy_n(sums, 18, out.entries);
  const double* b = a + 3 * dim * kStride;
  sum_columns<3, 3>(b, b, dim, count, sums);
  for (int c = 0; c < 3; ++c) std::copy_n(sums + 3 * c, 3, out.entries + 6 * (3 + c) + 3);
}

void multiply(int da, int db, const double* a, const double* b, int dim, int count, Product& out,
              std::int64_t& fallbacks) {
  if (a == b && da == 6) return square_six(a, dim, count, out);
  const int x = kernel_index(da), y = kernel_index(db);
  if (x >= 0 && y >= 0)
    kKernels[x][y](a, b, dim, count, out);
  else
    run_fallback(da, db, a, b, dim, count, out.entries), ++fallbacks;
}

// Blocks on the diagonal are added from the diagonal down alone.
void add(const Product& p, int da, int db, bool lower, const PairAddress& at, double* h) {
  if (at.kind != PairAddress::Kind::transposed)
    for (int c = 0; c < db; ++c)
      for (int i = lower ? c : 0; i < da; ++i) h[at.offset + std::int64_t{c} * at.ld + i] += p.entries[c * da + i];
  if (at.kind != PairAddress::Kind::stored)
    for (int i = 0; i < da; ++i)
      for (int c = 0; c < db; ++c) h[at.offset + std::int64_t{i} * at.ld + c] += p.entries[c * da + i];
}

void accumulate_run(const TablePlan& plan, const TablePlan::Run& run, const Batch& batch, LinearSystem& out,
                    std::int64_t& fallbacks) {
  const std::size_t n = plan.arguments.size();
  const int lane = static_cast<int>(run.first % Batch::kRows), count = static_cast<int>(run.count);
  const PairAddress* pair = &plan.pairs[run.first * (n * (n + 1) / 2)];
  auto columns = [&](std::size_t a) { return batch.J + plan.arguments[a].column * batch.dim * kStride + lane; };
  Product product;
  for (std::size_t a = 0; a < n; ++a) {
    const Target& target = plan.targets[run.first * n + a];
    const int da = plan.arguments[a].dim;
    const bool kept = !plan.arguments[a].landmark_type && target.kind == Target::Kind::kept;
    if (kept) {
      multiply(da, 1, columns(a), batch.r + lane, batch.dim, count, product, fallbacks);
      for (int i = 0; i < da; ++i) out.gradient[std::size_t(target.offset) + i] += product.entries[i];
    }
    for (std::size_t b = 0; b <= a; ++b, ++pair) {
      if (!kept || plan.arguments[b].landmark_type || pair->kind == PairAddress::Kind::none) continue;
      const int db = plan.arguments[b].dim;
      multiply(da, db, columns(a), columns(b), batch.dim, count, product, fallbacks);
      add(product, da, db, a == b, *pair, out.h.data());
    }
  }
}

}  // namespace

void accumulate_runs(const TablePlan& plan, std::size_t first, const Batch& batch, LinearSystem& out,
                     std::int64_t& fallbacks) {
  auto run = std::lower_bound(plan.runs.begin(), plan.runs.end(), first,
                              [](const TablePlan::Run& r, std::size_t at) { return r.first < at; });
  for (; run != plan.runs.end() && run->first < first + static_cast<std::size_t>(batch.rows); ++run)
    accumulate_run(plan, *run, batch, out, fallbacks);
}

}  // namespace oriel
