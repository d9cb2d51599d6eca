#include "oriel/linear/accumulate_runs.h"

#include <algorithm>
#include <array>

#include "oriel/linear/kernel_dims.h"
#include "oriel/linear/lanes.h"
#include "oriel/linear/linearize.h"

namespace oriel {
namespace {

using lanes::kNative, lanes::kStride, lanes::load_as, lanes::Native;

#if defined(__AVX512F__)
constexpr int kRegisters = 24;  // running sums at once
#else
constexpr int kRegisters = 12;
#endif
constexpr int kMostColumns = 4;

// Columns of an argument against others: each of these, times all of the argument's columns, is a column of sums.
struct Column {
  const double* from;
  double* to;      // DA values, one after the other; null: not wanted
  double* turned;  // DA values, `ld` apart; null: not wanted
  std::int64_t ld;
  int first;  // the sums before this one are not wanted
};

// Sums over rows and lanes of a_i b_c, for DA columns a and N columns b; `count` lanes, a multiple of eight. Sums of
// the lanes are made at the end, in registers.
template <int DA, int N>
void sum_columns(const double* a, const Column* b, int dim, int count) {
  Native s[N][DA] = {};
  for (int g = 0; g < count; g += kNative)
    for (int r = 0; r < dim; ++r) {
      Native y[N];
#pragma GCC unroll 4
      for (int c = 0; c < N; ++c) y[c] = load_as<Native>(b[c].from + r * kStride + g), lanes::keep(y[c]);
#pragma GCC unroll 9
      for (int i = 0; i < DA; ++i) {
        Native x = load_as<Native>(a + (i * dim + r) * kStride + g);
        lanes::keep(x);
#pragma GCC unroll 4
        for (int c = 0; c < N; ++c) s[c][i] += x * y[c];
      }
    }
#pragma GCC unroll 4
  for (int c = 0; c < N; ++c) {
    alignas(64) double sums[16];
    lanes::store_sums<DA>(s[c], sums);
    if (b[c].to != nullptr && b[c].first == 0) {
      lanes::add<DA>(b[c].to, sums);
    } else if (b[c].to != nullptr) {
      for (int i = b[c].first; i < DA; ++i) b[c].to[i] += sums[i];
    }
    for (int i = 0; b[c].turned != nullptr && i < DA; ++i) b[c].turned[i * b[c].ld] += sums[i];
  }
}

void sum_any(int da, const double* a, const Column& b, int dim, int count) {
  for (int i = b.first; i < da; ++i) {
    double sum = 0.0;
    for (int r = 0; r < dim; ++r)
      for (int l = 0; l < count; ++l) sum += a[(i * dim + r) * kStride + l] * b.from[r * kStride + l];
    if (b.to != nullptr) b.to[i] += sum;
    if (b.turned != nullptr) b.turned[i * b.ld] += sum;
  }
}

using Kernel = void (*)(const double*, const Column*, int, int);
template <int DA>
constexpr int kWidth = std::clamp(kRegisters / DA, 1, kMostColumns);
template <int DA>
constexpr std::array<Kernel, kMostColumns> kernels_of() {
  return {&sum_columns<DA, 1>, &sum_columns<DA, std::min(2, kWidth<DA>)>, &sum_columns<DA, std::min(3, kWidth<DA>)>,
          &sum_columns<DA, kWidth<DA>>};
}
constexpr std::array<std::array<Kernel, kMostColumns>, kKernelDims> kKernels = {
    kernels_of<1>(), kernels_of<2>(), kernels_of<3>(), kernels_of<6>(), kernels_of<7>(), kernels_of<9>()};
constexpr int kWidths[kKernelDims] = {kWidth<1>, kWidth<2>, kWidth<3>, kWidth<6>, kWidth<7>, kWidth<9>};

// Adds DA × n sums, as many columns at once as registers hold.
void sum(int da, const double* a, const Column* b, int n, int dim, int count, std::int64_t& fallbacks) {
  const int index = kernel_index(da);
  if (index < 0) ++fallbacks;
  for (int c = 0; index < 0 && c < n; ++c) sum_any(da, a, b[c], dim, count);
  for (int c = 0; index >= 0 && c < n;) {
    const int wide = std::min(n - c, kWidths[index]);
    kKernels[index][wide - 1](a, b + c, dim, count);
    c += wide;
  }
}

// One argument of a run: its gradient, its own block from the diagonal down, and its blocks with arguments before it.
struct Argument {
  static constexpr int kMost = (kMostLandmarkArguments - 1) * kLargestKernelDim + 1;
  Column columns[kMost];
  int n = 0, dim = 0;

  void add(const double* from, double* to, int first = 0) { columns[n++] = {from, to, nullptr, 0, first}; }
  void add_block(const double* from, int rows, int db, const PairAddress& at, double* h) {
    for (int c = 0; c < db; ++c) {
      Column& column = columns[n++];
      column = {from + c * rows * kStride, nullptr, nullptr, at.ld, 0};
      if (at.kind != PairAddress::Kind::transposed) column.to = h + at.offset + std::int64_t{c} * at.ld;
      if (at.kind != PairAddress::Kind::stored) column.turned = h + at.offset + c;
    }
  }
};

void accumulate_run(const TablePlan& plan, const TablePlan::Run& run, const Batch& batch, LinearSystem& out,
                    std::int64_t& fallbacks) {
  const std::size_t n = plan.arguments.size();
  const int lane = static_cast<int>(run.first % Batch::kRows), count = static_cast<int>(run.count), dim = batch.dim;
  const PairAddress* pair = &plan.pairs[run.first * (n * (n + 1) / 2)];
  double* const h = out.h.data();
  auto columns = [&](std::size_t a) { return batch.J + plan.arguments[a].column * dim * kStride + lane; };
  for (std::size_t a = 0; a < n; pair += ++a) {
    const Target& target = plan.targets[run.first * n + a];
    if (plan.arguments[a].landmark_type || target.kind != Target::Kind::kept) continue;
    const double* const own = columns(a);
    const PairAddress& diagonal = pair[a];
    Argument argument;
    argument.dim = plan.arguments[a].dim;
    argument.add(batch.r + lane, out.gradient.data() + target.offset);
    for (std::size_t b = 0; b < a; ++b)
      if (!plan.arguments[b].landmark_type && pair[b].kind != PairAddress::Kind::none)
        argument.add_block(columns(b), dim, plan.arguments[b].dim, pair[b], h);
    // Of six columns the last three need the last three alone.
    const bool halves = argument.dim == 6;
    for (int c = 0; c < (halves ? 3 : argument.dim); ++c)
      argument.add(own + c * dim * kStride, h + diagonal.offset + std::int64_t{c} * diagonal.ld, c);
    sum(argument.dim, own, argument.columns, argument.n, dim, count, fallbacks);
    if (!halves) continue;
    argument.n = 0;
    for (int c = 3; c < 6; ++c)
      argument.add(own + c * dim * kStride, h + diagonal.offset + std::int64_t{c} * diagonal.ld + 3, c - 3);
    sum(3, own + 3 * dim * kStride, argument.columns, 3, dim, count, fallbacks);
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
