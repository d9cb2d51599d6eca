#include "oriel/linear/accumulate.h"

#include <algorithm>
#include <array>

#include "oriel/linear/accumulate_landmarks.h"
#include "oriel/linear/accumulate_runs.h"
#include "oriel/linear/kernel_dims.h"
#include "oriel/linear/lanes.h"
#include "oriel/linear/linearize.h"

namespace oriel {
namespace {

using lanes::kLanes, lanes::kNative, lanes::kParts, lanes::kStride, lanes::load, lanes::load_as, lanes::Native,
    lanes::store, lanes::V8;

// Columns of J of eight rows: component r of column c, eight lanes, stands at from[(c * dim + r) * stride]. Those from
// `rows` on are zeros in all columns.
struct Columns {
  const double* from = nullptr;
  int dim = 0, stride = kStride, rows = 0;
};

// Where one lane's product goes; null: nowhere.
struct Destination {
  double* to = nullptr;
  std::int32_t ld = 0;
  PairAddress::Kind kind = PairAddress::Kind::none;
};
using Destinations = std::array<Destination, kLanes>;

// Products of eight rows, lane by lane: entries of a lane stand together, column by column.
struct Tile {
  static constexpr int kEntries = (kLargestKernelDim * kLargestKernelDim + 7) / 8 * 8;
  alignas(64) double by_lane[kLanes][kEntries];

  // Fills up with zeros.
  void fill(V8* entries, int count) {
    for (; count % 8 != 0; ++count) entries[count] = V8(0.0);
    for (int e = 0; e < count; e += 8) lanes::store_by_lane(entries + e, &by_lane[0][e], kEntries);
  }
};

// P = Aᵀ B over residual rows; the lower half alone where A = B.
template <int DA, int DB, bool kLower>
void multiply(const Columns& a, const Columns& b, Tile& tile) {
  const int dim = a.dim, rows = std::min(a.rows, b.rows);
  V8 p[Tile::kEntries];
  int e = 0;
  for (int c = 0; c < DB; e += DA - (kLower ? c : 0), ++c) {
    const int first = kLower ? c : 0;
#pragma GCC unroll 4
    for (int part = 0; part < kParts; ++part) {  // DA sums of one part are what registers hold
      const double* const x = a.from + part * kNative;
      const double* const y = b.from + part * kNative;
      Native s[DA];
      const Native y0 = load_as<Native>(y + c * dim * b.stride);
      for (int i = first; i < DA; ++i) s[i] = load_as<Native>(x + i * dim * a.stride) * y0;
      for (int r = 1; r < rows; ++r) {
        const Native yr = load_as<Native>(y + (c * dim + r) * b.stride);
        for (int i = first; i < DA; ++i) s[i] += load_as<Native>(x + (i * dim + r) * a.stride) * yr;
      }
      for (int i = first; i < DA; ++i) p[e + i - first].v[part] = s[i];
    }
  }
  tile.fill(p, e);
}

template <int DA, int DB>
void add_block(const double* q, const Destination& d) {
  switch (d.kind) {
    case PairAddress::Kind::none:
    case PairAddress::Kind::packed:  // never of two variables
      return;
    case PairAddress::Kind::stored:
      for (int c = 0; c < DB; ++c) lanes::add<DA>(d.to + std::int64_t{c} * d.ld, q + c * DA);
      return;
    case PairAddress::Kind::transposed:
      for (int c = 0; c < DB; ++c)
        for (int i = 0; i < DA; ++i) d.to[std::int64_t{i} * d.ld + c] += q[c * DA + i];
      return;
    case PairAddress::Kind::diagonal_twice:
      for (int c = 0; c < DB; ++c)
        for (int i = 0; i < DA; ++i) {
          d.to[std::int64_t{c} * d.ld + i] += q[c * DA + i];
          d.to[std::int64_t{i} * d.ld + c] += q[c * DA + i];
        }
      return;
  }
}

template <int D>
void add_lower(const double* q, const Destination& d) {
  if (d.kind == PairAddress::Kind::none) return;
  if (d.kind == PairAddress::Kind::packed) {  // what the tile is filled up with are zeros
    for (int k = 0; k < packed_half(D); k += kLanes) store(d.to + k, load(d.to + k) + load(q + k));
    return;
  }
  int e = 0;
  for (int c = 0; c < D; ++c)
    for (int i = c; i < D; ++i) d.to[std::int64_t{c} * d.ld + i] += q[e++];
}

template <int DA, int DB>
void pair_kernel(const Columns& a, const Columns& b, const Destinations& to) {
  Tile tile;
  if (DA == DB && a.from == b.from) {
    multiply<DA, DA, true>(a, b, tile);
    for (int l = 0; l < kLanes; ++l) add_lower<DA>(tile.by_lane[l], to[l]);
  } else {
    multiply<DA, DB, false>(a, b, tile);
    for (int l = 0; l < kLanes; ++l) add_block<DA, DB>(tile.by_lane[l], to[l]);
  }
}

// Any dimensions, one entry at a time.
void pair_fallback(int da, int db, const Columns& a, const Columns& b, const Destinations& to) {
  int e = 0;
  for (int c = 0; c < db; ++c)
    for (int i = a.from == b.from ? c : 0; i < da; ++i, ++e) {
      V8 s(0.0);
      for (int r = 0; r < a.dim; ++r)
        s += load(a.from + (i * a.dim + r) * a.stride) * load(b.from + (c * a.dim + r) * b.stride);
      for (int l = 0; l < kLanes; ++l) {
        const Destination& d = to[l];
        if (d.kind == PairAddress::Kind::none) continue;
        if (d.kind == PairAddress::Kind::packed) {
          d.to[e] += s[l];
          continue;
        }
        const bool turned = d.kind == PairAddress::Kind::transposed;
        d.to[turned ? std::int64_t{i} * d.ld + c : std::int64_t{c} * d.ld + i] += s[l];
        if (d.kind == PairAddress::Kind::diagonal_twice) d.to[std::int64_t{i} * d.ld + c] += s[l];
      }
    }
}

using Kernel = void (*)(const Columns&, const Columns&, const Destinations&);

template <int DA>
constexpr std::array<Kernel, kKernelDims> kernels_of() {
  return {&pair_kernel<DA, 1>, &pair_kernel<DA, 2>, &pair_kernel<DA, 3>,
          &pair_kernel<DA, 6>, &pair_kernel<DA, 7>, &pair_kernel<DA, 9>};
}
constexpr std::array<std::array<Kernel, kKernelDims>, kKernelDims> kKernels = {
    kernels_of<1>(), kernels_of<2>(), kernels_of<3>(), kernels_of<6>(), kernels_of<7>(), kernels_of<9>()};

Kernel find_kernel(int da, int db) {
  const int a = kernel_index(da), b = kernel_index(db);
  return a < 0 || b < 0 ? nullptr : kKernels[a][b];
}

// J of eight rows side by side. In a batch its entries stand 512 bytes apart, which share an eighth of the sets of the
// first-level cache: one as large as that of an IMU factor (15 × 30) would not stay there.
class Compact {
 public:
  static bool pays(const Batch& batch) {
    const int entries = batch.dim * batch.cols;
    return entries > 128 && entries <= kMost;
  }
  // Copies columns [column, column + dim).
  Columns copy(const Batch& batch, int lane, int column, int dim) {
    double* const to = entries_ + column * batch.dim * kLanes;
    const double* const from = batch.J + column * batch.dim * kStride + lane;
    int rows = 0;
    for (int r = batch.dim - 1; r >= 0; --r) {
      Pack::Mask any = {};
      for (int c = 0; c < dim; ++c) {
        const V8 v = load(from + (c * batch.dim + r) * kStride);
        store(to + (c * batch.dim + r) * kLanes, v);
        Pack::Mask bits;
        std::memcpy(&bits, &v, sizeof(bits));
        any = any | bits;
      }
      bool some = false;
      for (int l = 0; rows == 0 && l < kLanes; ++l) some |= any[l];
      if (some) rows = r + 1;
    }
    return {to, batch.dim, kLanes, std::max(rows, 1)};
  }

 private:
  static constexpr int kMost = 512;
  alignas(64) double entries_[kMost * kLanes];
};

// One group of eight lanes of one batch.
class Group {
 public:
  Group(const LinearStructure& structure, const TablePlan& plan, std::size_t first, int lane, const Batch& batch,
        LinearSystem& out, std::int64_t& fallbacks)
      : structure_(structure),
        plan_(plan),
        row_(first + lane),
        lane_(lane),
        batch_(batch),
        out_(out),
        fallbacks_(fallbacks) {
    lanes_ = std::min(kLanes, batch.rows - lane);
    const bool compact = Compact::pays(batch);
    for (std::size_t a = 0; a < plan.arguments.size() && a < kMostArguments; ++a) {
      const auto& argument = plan.arguments[a];
      columns_[a] =
          compact ? compact_.copy(batch, lane, argument.column, argument.dim)
                  : Columns{batch.J + argument.column * batch.dim * kStride + lane, batch.dim, kStride, batch.dim};
    }
  }

  void run() {
    const std::size_t n = plan_.arguments.size();
    std::size_t pair = 0;
    const std::size_t landmark = static_cast<std::size_t>(plan_.landmark_argument);  // its products are summed already
    for (std::size_t a = 0; a < n; ++a) {
      if (a != landmark) gradient(a);
      for (std::size_t b = 0; b <= a; ++b, ++pair)
        if (a != landmark && b != landmark) product(a, b, pair);
    }
  }

 private:
  bool valid(int l) const { return (batch_.valid >> (lane_ + l)) & 1; }
  const Target& target(int l, std::size_t a) const { return plan_.targets[(row_ + l) * plan_.arguments.size() + a]; }

  const PairAddress& pair_of(int l, std::size_t pair) const {
    const std::size_t n = plan_.arguments.size();
    return plan_.pairs[(row_ + l) * (n * (n + 1) / 2) + pair];
  }

  void gradient(std::size_t a) {
    const int da = plan_.arguments[a].dim;
    const Columns r = {batch_.r + lane_, batch_.dim, kStride, batch_.dim};
    Destinations to;
    for (int l = 0; l < lanes_; ++l) {
      const Target& t = target(l, a);
      if (t.kind == Target::Kind::fixed || !valid(l)) continue;
      const PairAddress& own = pair_of(l, a * (a + 1) / 2 + a);
      double* const at = own.kind == PairAddress::Kind::packed ? out_.h.data() + own.offset + packed_half(da)
                                                               : out_.gradient.data() + t.offset;
      to[l] = {at, 0, PairAddress::Kind::stored};
    }
    if (const Kernel kernel = find_kernel(da, 1))
      kernel(columns_[a], r, to);
    else
      pair_fallback(da, 1, columns_[a], r, to);
  }

  // H, V or W: rows of the product are those of argument a, but a landmark's stand on the right.
  void product(std::size_t a, std::size_t b, std::size_t pair) {
    const bool swap = plan_.arguments[a].landmark_type && !plan_.arguments[b].landmark_type;
    Destinations to;
    bool any = false;
    for (int l = 0; l < lanes_; ++l) {
      if (!valid(l)) continue;
      to[l] = destination(l, a, b, pair, swap);
      any = any || to[l].kind != PairAddress::Kind::none;
    }
    if (!any) return;
    const std::size_t x = swap ? b : a, y = swap ? a : b;
    const int da = plan_.arguments[x].dim, db = plan_.arguments[y].dim;
    if (const Kernel kernel = find_kernel(da, db)) {
      kernel(columns_[x], columns_[y], to);
    } else {
      ++fallbacks_;
      pair_fallback(da, db, columns_[x], columns_[y], to);
    }
  }

  Destination destination(int l, std::size_t a, std::size_t b, std::size_t pair, bool swap) {
    const Target &x = target(l, a), &y = target(l, b);
    using Kind = Target::Kind;
    if (x.kind == Kind::fixed || y.kind == Kind::fixed) return {};
    const std::size_t n = plan_.arguments.size();
    if (x.kind == Kind::kept && y.kind == Kind::kept) {
      const PairAddress& p = pair_of(l, pair);
      auto kind = p.kind;
      if (swap)
        kind = kind == PairAddress::Kind::stored       ? PairAddress::Kind::transposed
               : kind == PairAddress::Kind::transposed ? PairAddress::Kind::stored
                                                       : kind;
      return {out_.h.data() + p.offset, p.ld, kind};
    }
    const LandmarkBlock& m = structure_.landmarks()[plan_.landmark[row_ + l]];
    double* data = out_.landmarks.data();
    if (x.kind == Kind::landmark && y.kind == Kind::landmark) return {data + m.v(), m.dim, PairAddress::Kind::stored};
    const std::size_t kept = x.kind == Kind::kept ? a : b;
    const bool kept_is_row = kept == (swap ? b : a);
    return {data + m.w() + plan_.panel_row[(row_ + l) * n + kept], m.rows,
            kept_is_row ? PairAddress::Kind::stored : PairAddress::Kind::transposed};
  }

  const LinearStructure& structure_;
  const TablePlan& plan_;
  std::size_t row_;
  int lane_, lanes_;
  const Batch& batch_;
  LinearSystem& out_;
  std::int64_t& fallbacks_;
  static constexpr std::size_t kMostArguments = 16;
  Columns columns_[kMostArguments];
  Compact compact_;
};

}  // namespace

void accumulate(const LinearStructure& structure, const TablePlan& plan, std::size_t first, const Batch& batch,
                LinearSystem& out, std::int64_t& kernel_fallbacks) {
  if (plan.landmark_argument >= 0) accumulate_landmarks(structure, plan, first, batch, out, kernel_fallbacks);
  if (!plan.runs.empty()) return accumulate_runs(plan, first, batch, out, kernel_fallbacks);
  for (int lane = 0; lane < batch.rows; lane += kLanes)
    Group(structure, plan, first, lane, batch, out, kernel_fallbacks).run();
}

}  // namespace oriel
