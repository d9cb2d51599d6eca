#include "oriel/linear/landmark_schur.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "oriel/linear/dense_kernels.h"
#include "oriel/linear/dot.h"
#include "oriel/linear/lanes.h"

namespace oriel {
namespace {

constexpr int kPanelColumns = 96;  // of Z at once: with 64 rows it stays in the first-level cache's neighbour
constexpr double kRelativePivot = 1e-13;
constexpr int kLargestLandmark = 3;
constexpr std::int64_t kSum = 1 << 13;  // numbers of S that a worker sums at a time
constexpr int kTogether = 256;          // landmarks that a worker substitutes into at a time

// Lower Cholesky factor of V + D with inverse diagonal; a pivot that is rounding error gets a zero row (undetermined).
struct SmallCholesky {
  int n;
  double l[kLargestLandmark][kLargestLandmark] = {};
  double inverse[kLargestLandmark] = {};
  int undetermined = 0;  // bits

  SmallCholesky(const double* v, const double* damping, int dim) : n(dim) {
    for (int j = 0; j < n; ++j) {
      const double diagonal = v[j * n + j] + damping[j];
      double pivot = diagonal;
      for (int k = 0; k < j; ++k) pivot -= l[j][k] * l[j][k];
      if (!(pivot > kRelativePivot * diagonal) || !(diagonal > 0.0)) {
        undetermined |= 1 << j;
        continue;
      }
      const double root = std::sqrt(pivot);
      l[j][j] = root;
      inverse[j] = 1.0 / root;
      for (int i = j + 1; i < n; ++i) {
        double s = v[j * n + i];
        for (int k = 0; k < j; ++k) s -= l[i][k] * l[j][k];
        l[i][j] = s * inverse[j];
      }
    }
  }
  // y := L⁻¹ y
  void forward(double* y) const {
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < i; ++k) y[i] -= l[i][k] * y[k];
      y[i] *= inverse[i];
    }
  }
  // y := L⁻ᵀ y
  void backward(double* y) const {
    for (int i = n - 1; i >= 0; --i) {
      for (int k = i + 1; k < n; ++k) y[i] -= l[k][i] * y[k];
      y[i] *= inverse[i];
    }
  }
};

// Z = W L⁻ᵀ, columns of `rows` values with leading dimension ld; a vector of rows at a time through all L columns.
template <int L>
void make_z_of(const SmallCholesky& c, const double* __restrict w, std::int64_t rows, double* __restrict z,
               std::int64_t ld) {
  auto piece = [&]<class V>(V, std::int64_t i) {
    V x[L];
#pragma GCC unroll 3
    for (int j = 0; j < L; ++j) {
      x[j] = lanes::load_as<V>(w + j * rows + i);
#pragma GCC unroll 3
      for (int k = 0; k < j; ++k) x[j] -= x[k] * c.l[j][k];
      x[j] *= c.inverse[j];
      lanes::store(z + j * ld + i, x[j]);
    }
  };
  std::int64_t i = 0;
  for (; i + lanes::kNative <= rows; i += lanes::kNative) piece(lanes::Native{}, i);
  for (; i < rows; ++i) piece(0.0, i);
}
void make_z(const SmallCholesky& c, const double* w, int rows, double* z, std::int64_t ld) {
  static_assert(kLargestLandmark == 3);
  return c.n == 3   ? make_z_of<3>(c, w, rows, z, ld)
         : c.n == 2 ? make_z_of<2>(c, w, rows, z, ld)
                    : make_z_of<1>(c, w, rows, z, ld);
}

template <int N>
struct VectorOf;
template <>
struct VectorOf<1> {
  using type = double;
};
template <>
struct VectorOf<2> {
  using type = lanes::V2;
};
template <>
struct VectorOf<4> {
  using type = lanes::V4;
};
template <>
struct VectorOf<8> {
  using type = lanes::V8;
};
template <int N>
using VecN = typename VectorOf<N>::type;

// Column of S minus L columns of Z times factors, N rows at once.
template <int N, int L>
inline void subtract_rows(double* __restrict s, const VecN<N> (&z)[L], const double (&f)[L]) {
  auto x = lanes::load_as<VecN<N>>(s);
  for (int k = 0; k < L; ++k) x -= z[k] * f[k];
  lanes::store(s, x);
}

// S_ij -= Z_i Z_jᵀ; D × D blocks, L columns. Rows in pieces of whole vectors: 9 = 8 + 1, 6 = 4 + 2, 3 = 2 + 1.
template <int D, int L>
void subtract_block(const double* __restrict zi, const double* __restrict zj, std::int64_t ld, double* __restrict s,
                    std::int64_t lds) {
  constexpr int kHead = D == 9 ? 8 : D == 6 ? 4 : 2, kTail = D - kHead;
  VecN<kHead> head[L];
  VecN<kTail> tail[L];
  for (int k = 0; k < L; ++k) {
    head[k] = lanes::load_as<VecN<kHead>>(zi + k * ld);
    tail[k] = lanes::load_as<VecN<kTail>>(zi + k * ld + kHead);
  }
#pragma GCC unroll 9
  for (int c = 0; c < D; ++c) {
    double f[L];
    for (int k = 0; k < L; ++k) f[k] = zj[k * ld + c];
    subtract_rows<kHead, L>(s + c * lds, head, f);
    subtract_rows<kTail, L>(s + c * lds + kHead, tail, f);
  }
}
void subtract_any(const double* zi, const double* zj, std::int64_t ld, int di, int dj, int l, double* s,
                  const BlockAddress& at) {
  for (int c = 0; c < dj; ++c)
    for (int i = 0; i < di; ++i) {
      double x = 0.0;
      for (int k = 0; k < l; ++k) x += zi[k * ld + i] * zj[k * ld + c];
      s[at.transposed ? std::int64_t{i} * at.ld + c : std::int64_t{c} * at.ld + i] -= x;
    }
}

using BlockKernel = void (*)(const double*, const double*, std::int64_t, double*, std::int64_t);
BlockKernel find_kernel(int d, int l) {
  static constexpr BlockKernel kOf[3][3] = {{&subtract_block<3, 1>, &subtract_block<3, 2>, &subtract_block<3, 3>},
                                            {&subtract_block<6, 1>, &subtract_block<6, 2>, &subtract_block<6, 3>},
                                            {&subtract_block<9, 1>, &subtract_block<9, 2>, &subtract_block<9, 3>}};
  return d % 3 == 0 && d <= 9 && l <= 3 ? kOf[d / 3 - 1][l - 1] : nullptr;
}

}  // namespace

void LandmarkSchur::prepare(const LinearStructure& structure) {
  const double flops = structure.landmark_flops();
  undetermined_.clear();
  const int n = static_cast<int>(structure.landmarks().size());
  slices_ = !structure.landmark_panel() && flops > 4e6 ? 2 : 1;
  cuts_.assign(1, 0);
  double done = 0.0;
  for (int i = 0; i < n && static_cast<int>(cuts_.size()) < slices_; ++i) {
    const LandmarkBlock& l = structure.landmarks()[i];
    done += double(l.dim) * l.rows * (l.rows + 1);
    if (done >= flops * static_cast<double>(cuts_.size()) / slices_) cuts_.push_back(i + 1);
  }
  while (static_cast<int>(cuts_.size()) < slices_) cuts_.push_back(n);
  cuts_.push_back(n);
  if (static_cast<int>(slice_z_.size()) < slices_) {
    slice_z_.resize(slices_);
    slice_rhs_.resize(slices_);
    slice_undetermined_.resize(slices_);
  }
  largest_ = 0;
  for (const LandmarkBlock& l : structure.landmarks()) largest_ = std::max(largest_, (l.dim + 1) * (l.rows + 8));
  for (auto& z : slice_z_)
    if (static_cast<int>(z.size()) < largest_) z.resize(static_cast<std::size_t>(largest_));
  if (slices_ > 1) slice_s_.reserve((slices_ - 1) * structure.factorization().storage_size());
  if (structure.landmark_panel()) {
    const int rows = structure.panel_rows() + 1;
    const std::int64_t ld = dense::leading_dimension(rows);
    panel_.reserve(ld * (kPanelColumns + kLargestLandmark));
    product_.reserve(ld * (rows + 8));
  }
}

void LandmarkSchur::reduce(const LinearStructure& structure, const LinearSystem& system, const double* damping,
                           double* s, double* rhs, TaskPool* pool) {
  const std::int64_t size = structure.factorization().storage_size();
  undetermined_.clear();
  std::copy_n(system.h.data(), size, s);
  for (int i = 0; i < structure.kept_dim(); ++i) rhs[i] = -system.gradient[i];
  if (structure.landmarks().empty()) return;
  if (structure.landmark_panel()) return reduce_panel(structure, system, damping, s, rhs);
  parallel_for(pool, slices_, [&](int k, int) {
    double* sk = k == 0 ? s : slice_s_.data() + (k - 1) * size;
    if (k > 0) std::fill_n(sk, size, 0.0);
    slice_rhs_[k].assign(structure.kept_dim(), 0.0);
    reduce_slice(structure, system, damping, k, sk, slice_rhs_[k].data());
  });
  parallel_for(pool, slices_ > 1 ? static_cast<int>((size + kSum - 1) / kSum) : 0, [&](int part, int) {
    const std::int64_t from = part * kSum, count = std::min(kSum, size - from);
    for (int k = 1; k < slices_; ++k)
      dense::add(s + from, slice_s_.data() + (k - 1) * size + from, static_cast<int>(count));
  });
  for (int k = 0; k < slices_; ++k) {  // in the order of slices, whoever computed them
    for (int i = 0; i < structure.kept_dim(); ++i) rhs[i] += slice_rhs_[k][i];
    undetermined_.insert(undetermined_.end(), slice_undetermined_[k].begin(), slice_undetermined_[k].end());
  }
}

void LandmarkSchur::reduce_slice(const LinearStructure& structure, const LinearSystem& system, const double* damping,
                                 int slice, double* s, double* rhs) {
  const auto& kept = structure.kept();
  slice_undetermined_[slice].clear();
  double* z = slice_z_[slice].data();
  for (int n = cuts_[slice]; n < cuts_[slice + 1]; ++n) {
    const LandmarkBlock& l = structure.landmarks()[n];
    const double* data = system.landmarks.data();
    const SmallCholesky c(data + l.v(), damping + l.offset, l.dim);
    for (int k = 0; k < l.dim; ++k)
      if (c.undetermined >> k & 1) slice_undetermined_[slice].push_back(l.offset + k);
    const std::int64_t ld = l.rows;
    make_z(c, data + l.w(), l.rows, z, ld);
    double y[kLargestLandmark];
    for (int k = 0; k < l.dim; ++k) y[k] = -system.gradient[l.offset + k];
    c.forward(y);
    double* zy = z + l.dim * ld;
    for (int i = 0; i < l.rows; ++i) zy[i] = z[i] * y[0];
    for (int k = 1; k < l.dim; ++k)
      for (int i = 0; i < l.rows; ++i) zy[i] += z[k * ld + i] * y[k];
    subtract_pairs(structure, l, z, s);
    int row = 0;
    for (int a = 0; a < l.neighbours; ++a) {
      const KeptBlock& x = kept[structure.neighbours()[l.first_neighbour + a]];
      for (int i = 0; i < x.dim; ++i) rhs[x.offset + i] -= zy[row + i];
      row += x.dim;
    }
  }
}

// S -= Z Zᵀ, block by block of what sees the landmark.
void LandmarkSchur::subtract_pairs(const LinearStructure& structure, const LandmarkBlock& l, const double* z,
                                   double* s) const {
  const auto& kept = structure.kept();
  const std::int64_t ld = l.rows;
  const std::int32_t* neighbour = structure.neighbours().data() + l.first_neighbour;
  const BlockAddress* at = structure.landmark_pairs().data() + l.first_pair;
  int row = 0;
  for (int a = 0; a < l.neighbours; ++a) {
    const int da = kept[neighbour[a]].dim;
    const double* za = z + row;
    const BlockKernel kernel = find_kernel(da, l.dim);
    int other = 0;
    for (int b = 0; b <= a; ++b, ++at) {
      const int db = kept[neighbour[b]].dim;
      const double* zb = z + other;
      if (kernel != nullptr && db == da)  // a transposed block takes the product with its sides exchanged
        kernel(at->transposed ? zb : za, at->transposed ? za : zb, ld, s + at->offset, at->ld);
      else
        subtract_any(za, zb, ld, da, db, l.dim, s + at->offset, *at);
      other += db;
    }
    row += da;
  }
}

// Landmarks side by side: columns of Z are those of W L⁻ᵀ, and a last row is the right-hand side.
void LandmarkSchur::reduce_panel(const LinearStructure& structure, const LinearSystem& system, const double* damping,
                                 double* s, double* rhs) {
  const int panel_rows = structure.panel_rows(), rows = panel_rows + 1;
  const std::int64_t ld = dense::leading_dimension(rows);
  double* z = panel_.data();
  std::fill_n(product_.data(), ld * rows, 0.0);
  int columns = 0;
  auto flush = [&] {
    if (columns > 0) dense::syrk_lower_minus(product_.data(), ld, rows, z, ld, columns);
    columns = 0;
  };
  for (const LandmarkBlock& l : structure.landmarks()) {
    const double* data = system.landmarks.data();
    const SmallCholesky c(data + l.v(), damping + l.offset, l.dim);
    for (int k = 0; k < l.dim; ++k)
      if (c.undetermined >> k & 1) undetermined_.push_back(l.offset + k);
    double y[kLargestLandmark];
    for (int k = 0; k < l.dim; ++k) y[k] = -system.gradient[l.offset + k];
    c.forward(y);
    double* zl = z + columns * ld;
    for (int k = 0; k < l.dim; ++k)  // rows below the last are read by whole vectors
      for (std::int64_t i = dense::round_down_8(rows); i < ld; i += 8) lanes::store(zl + k * ld + i, lanes::V8(0.0));
    make_z(c, data + l.w(), panel_rows, zl, ld);
    for (int k = 0; k < l.dim; ++k) zl[k * ld + panel_rows] = y[k];
    columns += l.dim;
    if (columns >= kPanelColumns) flush();
  }
  flush();
  subtract_panel(structure, s, rhs);
}

// The product holds -Z Zᵀ; its last row -Z y.
void LandmarkSchur::subtract_panel(const LinearStructure& structure, double* s, double* rhs) {
  const auto& kept = structure.kept();
  const int first = structure.first_seen(), scalar = structure.first_scalar(), panel_rows = structure.panel_rows();
  const std::int64_t ld = dense::leading_dimension(panel_rows + 1);
  for (int i = first; i < static_cast<int>(kept.size()); ++i)
    for (int j = first; j <= i; ++j) {
      if (!structure.factorization().has(i, j)) continue;
      const BlockAddress at = structure.address(i, j);
      const double* p = product_.data() + (kept[j].offset - scalar) * ld + (kept[i].offset - scalar);
      for (int c = 0; c < kept[j].dim; ++c)
        for (int r = 0; r < kept[i].dim; ++r)
          s[at.offset + (at.transposed ? std::int64_t{r} * at.ld + c : std::int64_t{c} * at.ld + r)] += p[c * ld + r];
    }
  for (int i = 0; i < panel_rows; ++i) rhs[scalar + i] += product_.data()[i * ld + panel_rows];
}

void LandmarkSchur::back_substitute(const LinearStructure& structure, const LinearSystem& system, const double* damping,
                                    double* step, TaskPool* pool) {
  const std::size_t workers = pool == nullptr ? 1 : static_cast<std::size_t>(pool->workers());
  if (slice_z_.size() < workers) slice_z_.resize(workers);
  for (auto& z : slice_z_)
    if (static_cast<int>(z.size()) < largest_) z.resize(static_cast<std::size_t>(largest_));
  const int landmarks = static_cast<int>(structure.landmarks().size());
  parallel_for(pool, (landmarks + kTogether - 1) / kTogether, [&](int task, int worker) {
    double* gathered = slice_z_[static_cast<std::size_t>(worker)].data();
    for (int n = task * kTogether; n < std::min((task + 1) * kTogether, landmarks); ++n)
      substitute(structure, structure.landmarks()[static_cast<std::size_t>(n)], system, damping, gathered, step);
  });
}

// `gathered`: room for the step of the landmark's neighbours, side by side.
void LandmarkSchur::substitute(const LinearStructure& structure, const LandmarkBlock& l, const LinearSystem& system,
                               const double* damping, double* gathered, double* step) {
  const auto& kept = structure.kept();
  const double* data = system.landmarks.data();
  const SmallCholesky c(data + l.v(), damping + l.offset, l.dim);
  const double* near = structure.landmark_panel() ? step + structure.first_scalar() : gathered;
  int row = 0;
  for (int a = 0; near == gathered && a < l.neighbours; ++a) {
    const KeptBlock& b = kept[static_cast<std::size_t>(structure.neighbours()[l.first_neighbour + a])];
    for (int i = 0; i < b.dim; ++i) gathered[row + i] = step[b.offset + i];
    row += b.dim;
  }
  double x[kLargestLandmark];
  for (int k = 0; k < l.dim; ++k)
    x[k] = -system.gradient[static_cast<std::size_t>(l.offset + k)] -
           dot(data + l.w() + std::int64_t{k} * l.rows, near, l.rows);
  c.forward(x);
  c.backward(x);
  for (int k = 0; k < l.dim; ++k) step[l.offset + k] = x[k];
}

}  // namespace oriel
