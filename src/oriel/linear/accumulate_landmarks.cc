#include "oriel/linear/accumulate_landmarks.h"

#include <algorithm>
#include <array>

#include "oriel/linear/kernel_dims.h"
#include "oriel/linear/lanes.h"
#include "oriel/linear/linearize.h"

namespace oriel {
namespace {

using lanes::kLanes, lanes::kNative, lanes::kParts, lanes::kStride, lanes::load, lanes::load_as, lanes::Native,
    lanes::V8;

constexpr int kMostOthers = static_cast<int>(kMostLandmarkArguments) - 1;
constexpr int kMostEntries =
    (kLargestLandmarkDim + 1) * kLargestLandmarkDim + kMostOthers * kLargestKernelDim * kLargestLandmarkDim;

// out = Aᵀ B over residual rows, eight lanes at once, column by column; A and B are columns of J.
template <int DA, int DB>
void multiply(const double* a, const double* b, int dim, V8* out) {
#if defined(__AVX512F__)
  constexpr int kColumns = DB;  // 32 registers
#else
  constexpr int kColumns = std::min(DB, std::max(1, 12 / DA));  // of B at once; 16 registers
#endif
  for (int part = 0; part < kParts; ++part, a += kNative, b += kNative)
#pragma GCC unroll 3
    for (int c0 = 0; c0 < DB; c0 += kColumns) {
      Native s[DA * kColumns] = {};
      for (int r = 0; r < dim; ++r) {
        Native x[DA];
#pragma GCC unroll 9
        for (int i = 0; i < DA; ++i) x[i] = load_as<Native>(a + (i * dim + r) * kStride);
#pragma GCC unroll 3
        for (int c = 0; c < kColumns; ++c) {
          if (c0 + c >= DB) break;
          const Native y = load_as<Native>(b + ((c0 + c) * dim + r) * kStride);
#pragma GCC unroll 9
          for (int i = 0; i < DA; ++i) s[c * DA + i] += x[i] * y;
        }
      }
#pragma GCC unroll 27
      for (int k = 0; k < DA * kColumns; ++k)
        if (c0 * DA + k < DA * DB) out[c0 * DA + k].v[part] = s[k];
    }
}
void multiply_any(int da, int db, const double* a, const double* b, int dim, V8* out) {
  for (int c = 0; c < db; ++c)
    for (int i = 0; i < da; ++i) {
      V8 s(0.0);
      for (int r = 0; r < dim; ++r) s += load(a + (i * dim + r) * kStride) * load(b + (c * dim + r) * kStride);
      out[c * da + i] = s;
    }
}

using Kernel = void (*)(const double*, const double*, int, V8*);
template <int DB>
constexpr std::array<Kernel, kKernelDims> kernels_of() {
  return {&multiply<1, DB>, &multiply<2, DB>, &multiply<3, DB>, &multiply<6, DB>, &multiply<7, DB>, &multiply<9, DB>};
}
constexpr std::array<std::array<Kernel, kKernelDims>, kLargestLandmarkDim> kKernels = {kernels_of<1>(), kernels_of<2>(),
                                                                                       kernels_of<3>()};
Kernel find_kernel(int da, int db) { return kernel_index(da) < 0 ? nullptr : kKernels[db - 1][kernel_index(da)]; }

void add_any(double* to, const double* from, int dim) {
  switch (dim) {
    case 3:
      return lanes::add<3>(to, from);
    case 6:
      return lanes::add<6>(to, from);
    case 9:
      return lanes::add<9>(to, from);
    default:
      for (int i = 0; i < dim; ++i) to[i] += from[i];
  }
}

// What a plan's rows have in common.
struct Layout {
  struct Other {
    const double* columns = nullptr;  // of J
    int argument = 0, dim = 0, entry = 0;
    Kernel kernel = nullptr;
  };
  int landmark_dim = 0, count = 0, entries = 0;
  const double* landmark = nullptr;
  Other others[kMostOthers];

  Layout(const TablePlan& plan, const Batch& batch) {
    auto columns = [&](const TablePlan::Argument& a) { return batch.J + a.column * batch.dim * kStride; };
    const std::size_t m = static_cast<std::size_t>(plan.landmark_argument);
    landmark_dim = plan.arguments[m].dim;
    landmark = columns(plan.arguments[m]);
    entries = landmark_dim * (landmark_dim + 1);
    for (std::size_t a = 0; a < plan.arguments.size(); ++a) {
      if (a == m) continue;
      const int dim = plan.arguments[a].dim;
      others[count++] = {columns(plan.arguments[a]), static_cast<int>(a), dim, entries, find_kernel(dim, landmark_dim)};
      entries += dim * landmark_dim;
    }
  }
  // Of all other arguments; 0 where they differ or there are none.
  int common_dim() const {
    for (int k = 1; k < count; ++k)
      if (others[k].dim != others[0].dim) return 0;
    return count > 0 ? others[0].dim : 0;
  }
};

// V (whole), g, then W by argument, of eight rows: entries of a lane stand together.
struct Products {
  static constexpr int kEntries = (kMostEntries + 7) / 8 * 8;
  alignas(64) double by_lane[kLanes][kEntries];

  void fill(const Layout& layout, const Batch& batch, int lane, std::int64_t& fallbacks) {
    V8 p[kMostEntries + 8];
    const double* m = layout.landmark + lane;
    const int dm = layout.landmark_dim;
    const Kernel own = find_kernel(dm, dm), gradient = find_kernel(dm, 1);
    own(m, m, batch.dim, p);
    gradient(m, batch.r + lane, batch.dim, p + dm * dm);
    for (int k = 0; k < layout.count; ++k) {
      const Layout::Other& o = layout.others[k];
      if (o.kernel != nullptr)
        o.kernel(o.columns + lane, m, batch.dim, p + o.entry);
      else
        multiply_any(o.dim, dm, o.columns + lane, m, batch.dim, p + o.entry), ++fallbacks;
    }
    turn_over(p, layout.entries);
  }
  // A landmark of one number that `Others` poses see: all sums in registers at once.
  template <int Others>
  void fill_by_poses(const Layout& layout, const Batch& batch, int lane) {
    constexpr int kSums = 2 + 6 * Others;
#pragma GCC unroll 4
    for (int part = 0; part < kParts; ++part) {
      const int at = lane + part * kNative;
      Native p[(kSums + kNative - 1) / kNative * kNative] = {};
      for (int r = 0; r < batch.dim; ++r) {
        const Native m = load_as<Native>(layout.landmark + at + r * kStride);
        p[0] += m * m;
        p[1] += m * load_as<Native>(batch.r + at + r * kStride);
#pragma GCC unroll 12
        for (int i = 0; i < 6 * Others; ++i)
          p[2 + i] += load_as<Native>(layout.others[i / 6].columns + at + (i % 6 * batch.dim + r) * kStride) * m;
      }
#pragma GCC unroll 8
      for (int e = 0; e < kSums; e += kNative) {
        Native square[kNative];
#pragma GCC unroll 8
        for (int k = 0; k < kNative; ++k) square[k] = p[e + k];
        lanes::turn(square);
#pragma GCC unroll 8
        for (int l = 0; l < kNative; ++l) lanes::store(&by_lane[part * kNative + l][e], square[l]);
      }
    }
  }
  void turn_over(const V8* p, int entries) {
    for (int e = 0; e < entries; e += 8) lanes::store_by_lane(p + e, &by_lane[0][e], kEntries);
  }
};

// Adds one row's products to V and g, and to the rows of W of its kept arguments. DM: dimension of the landmark; D: of
// all other arguments, 0 where they differ.
template <int DM, int D>
void add_row(const LinearStructure& structure, const TablePlan& plan, const Layout& layout, std::size_t row,
             const double* from, double* store) {
  const LandmarkBlock& block = structure.landmarks()[static_cast<std::size_t>(plan.landmark[row])];
  const std::size_t n = plan.arguments.size();
  double* const v = store + block.v();  // g follows V
  for (int i = 0; i < DM * (DM + 1); ++i) v[i] += from[i];
  for (int k = 0; k < layout.count; ++k) {
    const Layout::Other& o = layout.others[k];
    const std::size_t at = row * n + static_cast<std::size_t>(o.argument);
    if (plan.targets[at].kind != Target::Kind::kept) continue;
    double* w = store + block.w() + plan.panel_row[at];
    for (int q = 0; q < DM; ++q, w += block.rows) {
      if constexpr (D > 0)
        lanes::add<D>(w, from + o.entry + q * D);
      else
        add_any(w, from + o.entry + q * o.dim, o.dim);
    }
  }
}
using AddRow = void (*)(const LinearStructure&, const TablePlan&, const Layout&, std::size_t, const double*, double*);
template <int DM>
AddRow find_add_row(int dim) {
  return dim == 6 ? &add_row<DM, 6> : dim == 9 ? &add_row<DM, 9> : &add_row<DM, 0>;
}

}  // namespace

void accumulate_landmarks(const LinearStructure& structure, const TablePlan& plan, std::size_t first,
                          const Batch& batch, LinearSystem& out, std::int64_t& kernel_fallbacks) {
  const Layout layout(plan, batch);
  const int dim = layout.common_dim();
  const AddRow add_row = layout.landmark_dim == 1   ? find_add_row<1>(dim)
                         : layout.landmark_dim == 2 ? find_add_row<2>(dim)
                                                    : find_add_row<3>(dim);
  const bool poses = layout.landmark_dim == 1 && (dim == 6 || layout.count == 0);
  double* const store = out.landmarks.data();
  Products products;
  for (int lane = 0; lane < batch.rows; lane += kLanes) {
    if (poses && layout.count == 2)
      products.fill_by_poses<2>(layout, batch, lane);
    else if (poses && layout.count == 0)
      products.fill_by_poses<0>(layout, batch, lane);
    else
      products.fill(layout, batch, lane, kernel_fallbacks);
    for (int l = 0; l < kLanes && lane + l < batch.rows; ++l) {
      const std::size_t row = first + static_cast<std::size_t>(lane + l);
      if ((batch.valid >> (lane + l) & 1) == 0 || plan.landmark[row] < 0) continue;
      add_row(structure, plan, layout, row, products.by_lane[l], store);
    }
  }
}

}  // namespace oriel
