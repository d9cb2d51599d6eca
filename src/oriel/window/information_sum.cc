#include "oriel/window/information_sum.h"

#include <algorithm>
#include <cfloat>
#include <cmath>

#include "oriel/linear/dense_kernels.h"
#include "oriel/linear/dot.h"
#include "oriel/linear/lanes.h"

namespace oriel {
namespace {

using lanes::kLanes, lanes::kStride, lanes::load, lanes::store, lanes::V8;
constexpr int kLargestLandmark = 3;

// Lower Cholesky factor of a landmark's block; a pivot that is rounding error gets a zero row and column.
struct SmallCholesky {
  double l[kLargestLandmark][kLargestLandmark] = {}, inverse[kLargestLandmark] = {};

  SmallCholesky(const double* v, int n) {
    for (int j = 0; j < n; ++j) {
      double pivot = v[j * kLargestLandmark + j];
      for (int k = 0; k < j; ++k) pivot -= l[j][k] * l[j][k];
      if (!(pivot > std::max(InformationSum::kRelativePivot * v[j * kLargestLandmark + j], DBL_MIN))) continue;
      inverse[j] = 1.0 / std::sqrt(pivot);
      for (int i = j + 1; i < n; ++i) {
        double s = v[j * kLargestLandmark + i];
        for (int k = 0; k < j; ++k) s -= l[i][k] * l[j][k];
        l[i][j] = s * inverse[j];
      }
    }
  }
};

}  // namespace

void InformationSum::begin(const MarginalScope& scope, const MarginalComponent& component) {
  scope_ = &scope, component_ = &component;
  n_ = component.dim();
  ld_ = dense::leading_dimension(n_);
  const std::int64_t size = static_cast<std::int64_t>(ld_) * (n_ + dense::round_up_8(1));
  h_.reserve(size);
  std::fill_n(h_.data(), size, 0.0);
  g_.reserve(ld_);
  std::fill_n(g_.data(), ld_, 0.0);
  taken_.assign(n_, 0.0);
  undetermined_.clear();
  panel_ld_ = dense::leading_dimension(component.seen_end - component.seen_begin);
  const int landmarks = std::min(component.landmark_dim, MarginalScope::kChunk * kLargestLandmark);
  panel_.reserve(static_cast<std::int64_t>(panel_ld_) * landmarks);
  std::fill_n(panel_.data(), static_cast<std::int64_t>(panel_ld_) * landmarks, 0.0);
  landmark_v_.assign(MarginalScope::kChunk * kLargestLandmark * kLargestLandmark, 0.0);
  landmark_g_.assign(MarginalScope::kChunk * kLargestLandmark, 0.0);
}

void InformationSum::add(const AbsorbedBatch& b) {
  const auto& v = scope_->variables();
  auto same = [&](int l, int m) {
    for (int a = 0; a < b.arguments; ++a) {
      const std::int32_t x = b.variable[l * AbsorbedBatch::kLargestArity + a];
      const std::int32_t y = b.variable[m * AbsorbedBatch::kLargestArity + a];
      if (x != y && !(v[x].eliminated && v[y].eliminated)) return false;
    }
    return true;
  };
  for (int begin = 0; begin < b.batch->rows;) {
    int end = begin + 1;
    while (end < b.batch->rows && same(begin, end)) ++end;
    lay_out(b, begin);
    add_products(*b.batch, begin, end);
    if (landmark_arg_ >= 0) add_landmarks(b, begin, end);
    begin = end;
  }
}

void InformationSum::lay_out(const AbsorbedBatch& b, int lane) {
  columns_.clear();
  targets_.clear();
  landmark_arg_ = -1;
  for (int a = 0; a < b.arguments; ++a) {
    const MarginalVariable& v = scope_->variables()[b.variable[lane * AbsorbedBatch::kLargestArity + a]];
    if (!v.has_columns()) continue;
    if (v.eliminated) {
      landmark_arg_ = a, landmark_column_ = b.argument[a].column, landmark_dim_ = v.dim;
      continue;
    }
    for (int i = 0; i < v.dim; ++i) {
      columns_.push_back(b.argument[a].column + i);
      targets_.push_back(v.column + i);
    }
  }
}

// H += JᵀJ and g += Jᵀr of all rows of the run.
void InformationSum::add_products(const Batch& batch, int begin, int end) {
  const int k = static_cast<int>(columns_.size());
  products_.pack(batch, columns_, begin, end);
  products_.for_each([&](int i, int c, double product) {
    const int row = targets_[i];
    if (c == k) {
      g_.data()[row] += product;
      return;
    }
    const int column = targets_[c];
    const bool twice = row == column && i != c;  // one variable in two places of a factor
    *at(std::max(row, column), std::min(row, column)) += twice ? 2.0 * product : product;
  });
}

// V, g and W of the landmarks: eight products at once, each added where its lane's landmark is.
void InformationSum::add_landmarks(const AbsorbedBatch& b, int begin, int end) {
  const Batch& batch = *b.batch;
  const int k = static_cast<int>(columns_.size()), stride = batch.dim * kStride, seen = component_->seen_begin;
  for (int g = begin / kLanes * kLanes; g < end; g += kLanes) {
    const int first = std::max(begin, g), last = std::min(end, g + kLanes);
    int column[kLanes] = {}, slot[kLanes] = {};
    for (int l = first; l < last; ++l) {
      const MarginalVariable& v = scope_->variables()[b.variable[l * AbsorbedBatch::kLargestArity + landmark_arg_]];
      column[l - g] = v.chunk_column, slot[l - g] = v.chunk_slot;
    }
    auto product = [&](const double* x, const double* y) {
      V8 s(0.0);
      for (int r = 0; r < batch.dim; ++r) s += load(x + r * kStride + g) * load(y + r * kStride + g);
      return s;
    };
    for (int q = 0; q < landmark_dim_; ++q) {
      const double* y = batch.J + (landmark_column_ + q) * stride;
      for (int p = q; p < landmark_dim_; ++p) {
        const V8 s = product(batch.J + (landmark_column_ + p) * stride, y);
        for (int l = first; l < last; ++l) landmark_v_[(slot[l - g] * 3 + q) * 3 + p] += s[l - g];
      }
      const V8 s = product(batch.r, y);
      for (int l = first; l < last; ++l) landmark_g_[slot[l - g] * 3 + q] += s[l - g];
      for (int i = 0; i < k; ++i) {
        const V8 w = product(batch.J + columns_[i] * stride, y);
        double* const row = panel_.data() + targets_[i] - seen;
        for (int l = first; l < last; ++l) row[static_cast<std::int64_t>(column[l - g] + q) * panel_ld_] += w[l - g];
      }
    }
  }
}

// With V = L Lᵀ and Z = W L⁻ᵀ: H -= Z Zᵀ, g -= Z (L⁻¹ g_l).
void InformationSum::eliminate_landmarks(int chunk) {
  const int seen = component_->seen_begin, n = component_->seen_end - seen;
  int columns = 0;
  for (std::uint32_t o = component_->variables_begin; o < component_->variables_end; ++o) {
    const std::uint32_t at = scope_->ordered()[o];
    const MarginalVariable& v = scope_->variables()[at];
    if (!v.eliminated) break;
    if (v.chunk != chunk) continue;
    const SmallCholesky c(&landmark_v_[v.chunk_slot * 9], v.dim);
    double* const z = panel_.data() + static_cast<std::int64_t>(v.chunk_column) * panel_ld_;
    for (int j = 0; j < v.dim; ++j) {
      if (c.inverse[j] == 0.0) undetermined_.push_back({at, j});
      double y = landmark_g_[v.chunk_slot * 3 + j];
      double* const zj = z + static_cast<std::int64_t>(j) * panel_ld_;
      for (int k = 0; k < j; ++k) {
        const double* const zk = z + static_cast<std::int64_t>(k) * panel_ld_;
        for (int i = 0; i < n; ++i) zj[i] -= c.l[j][k] * zk[i];
        y -= c.l[j][k] * landmark_g_[v.chunk_slot * 3 + k];
      }
      for (int i = 0; i < n; ++i) zj[i] *= c.inverse[j];
      y *= c.inverse[j];
      landmark_g_[v.chunk_slot * 3 + j] = y;
      for (int i = 0; i < n; ++i) taken_[seen + i] += zj[i] * zj[i], g_.data()[seen + i] -= zj[i] * y;
    }
    columns += v.dim;
  }
  if (n > 0 && columns > 0) dense::syrk_lower_minus(at(seen, seen), ld_, n, panel_.data(), panel_ld_, columns);
  std::fill_n(panel_.data(), static_cast<std::int64_t>(panel_ld_) * columns, 0.0);
  std::fill(landmark_v_.begin(), landmark_v_.end(), 0.0);
  std::fill(landmark_g_.begin(), landmark_g_.end(), 0.0);
}

// H += RᵀR, g += Rᵀr. Columns that stand side by side in both are added as one.
void InformationSum::add(const AbsorbedPrior& p) {
  const int ld = prior_product_.subtract({p.rows, p.cols, p.R, nullptr});
  std::vector<int>& together = columns_;
  together.assign(static_cast<std::size_t>(p.cols), 1);
  for (int c = p.cols - 1; c > 0; --c)
    if (p.target[c - 1] >= 0 && p.target[c] == p.target[c - 1] + 1) together[c - 1] = together[c] + 1;
  for (int c = 0; c < p.cols; ++c) {
    const int column = p.target[c];
    if (column < 0) continue;
    g_.data()[column] += dot(p.R + static_cast<std::int64_t>(c) * p.rows, p.r, p.rows);
    const double* const from = prior_product_.product.data() + std::int64_t{c} * ld;
    for (int i = c, n = 0; i < p.cols; i += n) {
      n = together[i];
      const int row = p.target[i];
      if (row < 0) continue;
      double* const to = row >= column ? at(row, column) : at(column, row);
      const std::int64_t stride = row >= column ? 1 : ld_;
      if (stride == 1)
        for (int k = 0; k < n; ++k) to[k] -= from[i + k];
      else
        for (int k = 0; k < n; ++k) to[k * stride] -= from[i + k];
    }
  }
}

// H scaled to a unit diagonal as it was before anything was taken away, so that rounding is as large in every row.
void InformationSum::scale() {
  scale_.reserve(ld_);
  active_.reserve(ld_);
  std::fill_n(scale_.data(), ld_, 0.0);
  std::fill_n(active_.data(), ld_, 0.0);
  diagonal_.resize(n_);
  for (int j = 0; j < n_; ++j) {
    const double whole = *at(j, j) + taken_[j];
    scale_.data()[j] = whole > DBL_MIN ? 1.0 / std::sqrt(whole) : 0.0;
    active_.data()[j] = 1.0;
  }
  for (int j = 0; j < n_; ++j) {
    double* const column = at(0, j);
    const double s = scale_.data()[j];
    g_.data()[j] *= s;
    for (int i = j / kLanes * kLanes; i < ld_; i += kLanes)
      store(column + i, load(column + i) * load(scale_.data() + i) * s);
    diagonal_[j] = column[j];
  }
}

// The next row of the factor, for pivot p: column p of what is left. What the steps since `block` take away from it is
// made up for here; what those before took is in H.
void InformationSum::step(int p, int block) {
  double* const l = factor_.data() + static_cast<std::int64_t>(steps_) * ld_;
  for (int i = 0; i < p; ++i) l[i] = *at(p, i);  // the lower triangle is all there is
  std::copy(at(p, p), at(0, p) + ld_, l + p);
  const double root = std::sqrt(diagonal_[p]), inverse = 1.0 / root;
  const double y = g_.data()[p] * inverse;
  for (int i = 0; i < ld_; i += kLanes) {
    V8 x = load(l + i);
    for (int k = block; k < steps_; ++k) {
      const double* const row = factor_.data() + static_cast<std::int64_t>(k) * ld_;
      x -= load(row + i) * row[p];
    }
    x *= load(active_.data() + i) * inverse;
    store(l + i, x);
    store(g_.data() + i, load(g_.data() + i) - x * y);
  }
  l[p] = root;
  active_.data()[p] = diagonal_[p] = 0.0;
  for (int i = 0; i < n_; ++i) diagonal_[i] -= l[i] * l[i];
  right_.push_back(y);
  roots_.push_back(root);
  ++steps_;
}

// Steps of Cholesky with the largest of the pivots [begin, end) next, until all that is left there is rounding error:
// without the choice, errors would grow where H is singular (N. Higham, "Analysis of the Cholesky decomposition of a
// semi-definite matrix", 1990, section 4). Rows and columns stay in place; H is brought up to date every few steps.
void InformationSum::eliminate(int begin, int end) {
  constexpr int kBlock = 16;
  for (int block = steps_, taken = 0; taken <= end - begin; ++taken) {
    const auto largest = std::max_element(diagonal_.begin() + begin, diagonal_.begin() + end);
    const bool done = begin == end || !(*largest > kRelativePivot);
    if (done || steps_ - block == kBlock) {
      dense::syrk_lower_minus(h_.data(), ld_, n_, factor_.data() + static_cast<std::int64_t>(block) * ld_, ld_,
                              steps_ - block);
      block = steps_;
    }
    if (done) return;
    step(static_cast<int>(largest - diagonal_.begin()), block);
  }
}

// Of columns from `begin` on, in rows of the factor from `first_row` on: where the entry of H that one stands for is
// rounding error, it becomes zero, as in echelon.h.
void InformationSum::forget_rounding(int first_row, int begin) {
  for (int k = first_row; k < steps_; ++k) {
    double* const row = factor_.data() + static_cast<std::int64_t>(k) * ld_;
    for (int c = begin; c < n_; ++c)
      if (!(std::fabs(row[c]) * roots_[k] > kRounding)) row[c] = 0.0;
  }
}

// Cholesky without choice of pivots, in blocks and so several times faster: as good where every pivot is well above
// rounding error. False, and H as it was, if one is not.
bool InformationSum::factor_at_once() {
  std::copy_n(h_.data(), static_cast<std::int64_t>(ld_) * n_, factor_.data());
  threshold_.assign(n_, kSafePivot);
  inverse_.resize(n_);
  dense::factor_panel(factor_.data(), ld_, n_, n_, threshold_.data(), inverse_.data());
  if (std::find(inverse_.begin(), inverse_.end(), 0.0) != inverse_.end()) return false;
  dense::solve_panel_lower(factor_.data(), ld_, n_, n_, inverse_.data(), g_.data());
  right_.assign(g_.data(), g_.data() + n_);
  std::fill_n(active_.data(), n_, 0.0);
  for (int j = 0; j < n_; ++j) roots_.push_back(*(factor_.data() + static_cast<std::int64_t>(j) * ld_ + j));
  for (int j = 1; j < n_; ++j) std::fill_n(factor_.data() + static_cast<std::int64_t>(j) * ld_, j, 0.0);
  steps_ = n_;
  return true;
}

void InformationSum::finish(SquareRootRows& out) {
  const int leaving = component_->leaving_dim;
  factor_.reserve(static_cast<std::int64_t>(ld_) * n_);
  right_.clear();
  roots_.clear();
  steps_ = 0;
  scale();
  int first = leaving;
  if (!factor_at_once()) {
    eliminate(0, leaving);
    first = steps_;
    eliminate(leaving, n_);
  }
  forget_rounding(out.keep_conditional ? 0 : first, leaving);
  out.undetermined = undetermined_;
  for (std::uint32_t o = component_->variables_begin; o < component_->variables_end; ++o) {
    const MarginalVariable& v = scope_->variables()[scope_->ordered()[o]];
    if (v.eliminated || v.column >= leaving) continue;
    for (int i = 0; i < v.dim; ++i)
      if (active_.data()[v.column + i] != 0.0) out.undetermined.push_back({scope_->ordered()[o], i});
  }
  out.rows = steps_ - first, out.cols = n_ - leaving;
  write_rows(first, out.rows, leaving, out.R, out.d);
  out.conditional_rows = out.keep_conditional ? first : 0;
  write_rows(0, out.conditional_rows, 0, out.conditional_R, out.conditional_d);
}

// Columns from `first_column` on, unscaled.
void InformationSum::write_rows(int first_row, int rows, int first_column, std::vector<double>& R,
                                std::vector<double>& d) const {
  const int cols = n_ - first_column;
  R.resize(static_cast<std::size_t>(rows) * cols);
  for (int c = 0; c < cols; ++c) {
    const double scale = scale_.data()[first_column + c], unscale = scale > 0.0 ? 1.0 / scale : 0.0;
    const double* const from = factor_.data() + static_cast<std::int64_t>(first_row) * ld_ + first_column + c;
    double* const to = R.data() + static_cast<std::size_t>(c) * rows;
    for (int k = 0; k < rows; ++k) to[k] = from[static_cast<std::int64_t>(k) * ld_] * unscale;
  }
  d.assign(right_.begin() + first_row, right_.begin() + first_row + rows);
}

}  // namespace oriel
