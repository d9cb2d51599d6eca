#include "oriel/linear/schur_conjugate_gradient.h"

#include <algorithm>
#include <cmath>

#include "oriel/linear/dot.h"

namespace oriel {
namespace {

constexpr int kLargest = 3;  // dimension of a landmark
constexpr double kRelativePivot = 1e-13;

// Inverse of a symmetric positive definite n × n matrix in place (column-major, whole), by Gauss–Jordan without
// pivoting. A pivot that is rounding error takes its row and column out; their number comes back.
int invert(double* a, int n) {
  int bad = 0;
  double diagonal[16];
  for (int k = 0; k < n; ++k) diagonal[k] = a[k * n + k];
  for (int k = 0; k < n; ++k) {
    const double pivot = a[k * n + k];
    if (!(pivot > kRelativePivot * diagonal[k])) {
      ++bad;
      for (int i = 0; i < n; ++i) a[i * n + k] = a[k * n + i] = 0.0;
      continue;
    }
    const double inverse = 1.0 / pivot;
    for (int j = 0; j < n; ++j) {
      if (j == k) continue;
      const double f = a[j * n + k] * inverse;
      for (int i = 0; i < n; ++i)
        if (i != k) a[j * n + i] -= f * a[k * n + i];
    }
    for (int i = 0; i < n; ++i) {
      if (i == k) continue;
      a[k * n + i] *= -inverse;
      a[i * n + k] *= inverse;
    }
    a[k * n + k] = inverse;
  }
  return bad;
}

void add_scaled(double factor, const std::vector<double>& x, double* y) {
  for (std::size_t i = 0; i < x.size(); ++i) y[i] += factor * x[i];
}

double product_of(const std::vector<double>& a, const std::vector<double>& b) {
  return dot(a.data(), b.data(), static_cast<int>(a.size()));
}

// Rows of W that belong to each kept block that sees the landmark: f(block, first row).
template <class F>
void for_each_neighbour(const LinearStructure& structure, const LandmarkBlock& l, F&& f) {
  const auto& kept = structure.kept();
  int row = 0;
  if (structure.landmark_panel()) {
    for (int k = structure.first_seen(); k < static_cast<int>(kept.size()); row += kept[k].dim, ++k) f(k, row);
    return;
  }
  for (int a = 0; a < l.neighbours; ++a) {
    const int k = structure.neighbours()[static_cast<std::size_t>(l.first_neighbour) + static_cast<std::size_t>(a)];
    f(k, row);
    row += kept[k].dim;
  }
}

}  // namespace

void SchurConjugateGradient::prepare(const LinearStructure& structure) {
  std::size_t size = 0;
  int widest = 0;
  block_at_.clear();
  for (const KeptBlock& b : structure.kept()) {
    block_at_.push_back(size);
    size += static_cast<std::size_t>(b.dim) * static_cast<std::size_t>(b.dim);
  }
  block_.resize(size);
  inverse_.resize(structure.landmarks().size() * kLargest * kLargest);
  for (const LandmarkBlock& l : structure.landmarks()) widest = std::max(widest, l.rows);
  const auto n = static_cast<std::size_t>(structure.kept_dim());
  for (auto* v : {&b_, &r_, &z_, &p_, &sp_}) v->resize(n);
  for (int k = 0; k < kSlices; ++k) {
    near_[k].resize(2 * static_cast<std::size_t>(widest));
    sum_[k].resize(n);
  }
}

SchurConjugateGradient::Report SchurConjugateGradient::solve(const LinearStructure& structure,
                                                             const LinearSystem& system, const HessianProduct& product,
                                                             const double* damping,
                                                             const ConjugateGradientOptions& options, double* step,
                                                             TaskPool* pool) {
  invert_landmarks(structure, system, damping);
  make_right_side(structure, system);
  make_preconditioner(structure, system, damping);
  const std::size_t n = b_.size();
  std::fill_n(step, n, 0.0);
  r_ = b_;
  precondition(structure, r_.data(), z_.data());
  p_ = z_;
  double rz = product_of(r_, z_), quadratic = 0.0;
  const double least = 1e-28 * rz;
  Report report;
  report.undetermined = undetermined_;
  while (rz > least && report.iterations < options.max_iterations) {
    multiply(structure, system, product, damping, p_.data(), sp_.data(), pool);
    const double curvature = product_of(p_, sp_);
    if (!(curvature > 0.0)) break;  // rounding: S is positive semidefinite
    const double alpha = rz / curvature;
    add_scaled(alpha, p_, step);
    add_scaled(-alpha, sp_, r_.data());
    ++report.iterations;
    const double gain = 0.5 * alpha * rz;  // by which this step lowers ½ xᵀ S x - bᵀ x
    quadratic += gain;
    if (report.iterations * gain <= options.forcing * quadratic) break;
    precondition(structure, r_.data(), z_.data());
    const double next = product_of(r_, z_), beta = next / rz;
    rz = next;
    for (std::size_t i = 0; i < n; ++i) p_[i] = z_[i] + beta * p_[i];
  }
  back_substitute(structure, system, step);
  report.finite = std::isfinite(rz) && std::isfinite(quadratic);
  return report;
}

void SchurConjugateGradient::invert_landmarks(const LinearStructure& structure, const LinearSystem& system,
                                              const double* damping) {
  undetermined_ = 0;
  double* out = inverse_.data();
  for (const LandmarkBlock& l : structure.landmarks()) {
    const double* v = system.landmarks.data() + l.v();
    for (int c = 0; c < l.dim; ++c)
      for (int r = 0; r < l.dim; ++r)
        out[c * l.dim + r] = v[std::max(r, c) + std::min(r, c) * l.dim] + (r == c ? damping[l.offset + c] : 0.0);
    undetermined_ += invert(out, l.dim);
    out += kLargest * kLargest;
  }
}

// b = -g + Σ W (V + D)⁻¹ g_l.
void SchurConjugateGradient::make_right_side(const LinearStructure& structure, const LinearSystem& system) {
  for (std::size_t i = 0; i < b_.size(); ++i) b_[i] = -system.gradient[i];
  const double* inverse = inverse_.data();
  double* sum = near_[0].data();
  for (const LandmarkBlock& l : structure.landmarks()) {
    const double* w = system.landmarks.data() + l.w();
    std::fill_n(sum, l.rows, 0.0);
    for (int c = 0; c < l.dim; ++c) {
      double y = 0.0;
      for (int k = 0; k < l.dim; ++k) y += inverse[c * l.dim + k] * system.gradient[l.offset + k];
      for (int i = 0; i < l.rows; ++i) sum[i] += w[std::int64_t{c} * l.rows + i] * y;
    }
    HessianProduct::scatter(structure, l, sum, b_.data());
    inverse += kLargest * kLargest;
  }
}

void SchurConjugateGradient::make_preconditioner(const LinearStructure& structure, const LinearSystem& system,
                                                 const double* damping) {
  const auto& kept = structure.kept();
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const int dim = kept[k].dim;
    const BlockAddress at = structure.address(static_cast<int>(k), static_cast<int>(k));
    double* out = &block_[block_at_[k]];
    for (int c = 0; c < dim; ++c)
      for (int r = 0; r < dim; ++r)
        out[c * dim + r] = system.h.data()[at.offset + std::max(r, c) + std::int64_t{std::min(r, c)} * at.ld] +
                           (r == c ? damping[kept[k].offset + c] : 0.0);
  }
  const double* inverse = inverse_.data();
  for (const LandmarkBlock& l : structure.landmarks()) {
    const double* w = system.landmarks.data() + l.w();
    for_each_neighbour(structure, l, [&](int k, int row) {
      const int dim = kept[static_cast<std::size_t>(k)].dim;
      double* out = &block_[block_at_[static_cast<std::size_t>(k)]];
      for (int a = 0; a < l.dim; ++a)
        for (int b = 0; b < l.dim; ++b) {
          const double f = inverse[a * l.dim + b];
          const double *wa = w + std::int64_t{a} * l.rows + row, *wb = w + std::int64_t{b} * l.rows + row;
          for (int c = 0; c < dim; ++c)
            for (int r = 0; r < dim; ++r) out[c * dim + r] -= f * wa[r] * wb[c];
        }
    });
    inverse += kLargest * kLargest;
  }
  for (std::size_t k = 0; k < kept.size(); ++k) invert(&block_[block_at_[k]], kept[k].dim);
}

void SchurConjugateGradient::precondition(const LinearStructure& structure, const double* r, double* z) const {
  const auto& kept = structure.kept();
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const KeptBlock& b = kept[k];
    const double* m = &block_[block_at_[k]];
    for (int i = 0; i < b.dim; ++i) {
      double s = 0.0;
      for (int c = 0; c < b.dim; ++c) s += m[c * b.dim + i] * r[b.offset + c];
      z[b.offset + i] = s;
    }
  }
}

void SchurConjugateGradient::multiply(const LinearStructure& structure, const LinearSystem& system,
                                      const HessianProduct& product, const double* damping, const double* p,
                                      double* out, TaskPool* pool) {
  product.kept(system.h.data(), p, out);
  for (std::size_t i = 0; i < b_.size(); ++i) out[i] += damping[i] * p[i];
  const std::size_t n = structure.landmarks().size();
  parallel_for(pool, kSlices, [&](int slice, int) {
    std::vector<double>& sum = sum_[slice];
    std::fill(sum.begin(), sum.end(), 0.0);
    double *x = near_[slice].data(), *y = x + near_[slice].size() / 2;
    for (std::size_t j = n * slice / kSlices; j < n * (slice + 1) / kSlices; ++j) {
      const LandmarkBlock& l = structure.landmarks()[j];
      const double *w = system.landmarks.data() + l.w(), *inverse = &inverse_[j * kLargest * kLargest];
      HessianProduct::gather(structure, l, p, x);
      double t[kLargest];
      for (int c = 0; c < l.dim; ++c) t[c] = dot(w + std::int64_t{c} * l.rows, x, l.rows);
      for (int c = 0; c < l.dim; ++c) {
        double f = 0.0;
        for (int k = 0; k < l.dim; ++k) f += inverse[c * l.dim + k] * t[k];
        const double* column = w + std::int64_t{c} * l.rows;
        if (c == 0)
          for (int i = 0; i < l.rows; ++i) y[i] = column[i] * f;
        else
          for (int i = 0; i < l.rows; ++i) y[i] += column[i] * f;
      }
      HessianProduct::scatter(structure, l, y, sum.data());
    }
  });
  for (const auto& sum : sum_) add_scaled(-1.0, sum, out);
}

void SchurConjugateGradient::back_substitute(const LinearStructure& structure, const LinearSystem& system,
                                             double* step) {
  const double* inverse = inverse_.data();
  double* x = near_[0].data();
  for (const LandmarkBlock& l : structure.landmarks()) {
    const double* w = system.landmarks.data() + l.w();
    HessianProduct::gather(structure, l, step, x);
    double t[kLargest];
    for (int c = 0; c < l.dim; ++c)
      t[c] = -system.gradient[l.offset + c] - dot(w + std::int64_t{c} * l.rows, x, l.rows);
    for (int c = 0; c < l.dim; ++c) {
      double y = 0.0;
      for (int k = 0; k < l.dim; ++k) y += inverse[c * l.dim + k] * t[k];
      step[l.offset + c] = y;
    }
    inverse += kLargest * kLargest;
  }
}

}  // namespace oriel
