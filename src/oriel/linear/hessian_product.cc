#include "oriel/linear/hessian_product.h"

#include <algorithm>

#include "oriel/linear/dot.h"

namespace oriel {

void HessianProduct::prepare(const LinearStructure& structure) {
  if (version_ == structure.version()) return;
  version_ = structure.version();
  kept_dim_ = structure.kept_dim();
  blocks_.clear();
  const auto& kept = structure.kept();
  int widest = 0;
  for (int i = 0; i < static_cast<int>(kept.size()); ++i) {
    auto add = [&](int j) {
      const BlockAddress at = structure.address(i, j);
      blocks_.push_back({at.offset, static_cast<std::int32_t>(at.ld), kept[i].dim, kept[j].dim, kept[i].offset,
                         kept[j].offset, at.transposed, i == j});
    };
    for (const int j : structure.pattern().neighbours(i))
      if (j < i) add(j);
    add(i);
  }
  for (const LandmarkBlock& l : structure.landmarks()) widest = std::max(widest, l.rows);
  near_x_.resize(static_cast<std::size_t>(widest));
  near_y_.resize(static_cast<std::size_t>(widest));
}

void HessianProduct::kept(const double* h, const double* x, double* y) const {
  std::fill_n(y, kept_dim_, 0.0);
  for (const Block& b : blocks_) {
    const double* a = h + b.offset;
    for (int c = 0; c < b.cols; ++c)
      for (int r = b.diagonal ? c : 0; r < b.rows; ++r) {
        const double v = a[b.transposed ? std::int64_t{r} * b.ld + c : std::int64_t{c} * b.ld + r];
        y[b.row + r] += v * x[b.col + c];
        if (!b.diagonal || r > c) y[b.col + c] += v * x[b.row + r];
      }
  }
}

void HessianProduct::gather(const LinearStructure& structure, const LandmarkBlock& l, const double* x, double* out) {
  if (structure.landmark_panel()) {
    std::copy_n(x + structure.first_scalar(), l.rows, out);
    return;
  }
  for (int k = 0; k < l.neighbours; ++k) {
    const KeptBlock& b = structure.kept()[static_cast<std::size_t>(structure.neighbours()[l.first_neighbour + k])];
    for (int i = 0; i < b.dim; ++i) *out++ = x[b.offset + i];
  }
}

void HessianProduct::scatter(const LinearStructure& structure, const LandmarkBlock& l, const double* in, double* y) {
  if (structure.landmark_panel()) {
    for (int i = 0; i < l.rows; ++i) y[structure.first_scalar() + i] += in[i];
    return;
  }
  for (int k = 0; k < l.neighbours; ++k) {
    const KeptBlock& b = structure.kept()[static_cast<std::size_t>(structure.neighbours()[l.first_neighbour + k])];
    for (int i = 0; i < b.dim; ++i) y[b.offset + i] += *in++;
  }
}

void HessianProduct::whole(const LinearStructure& structure, const LinearSystem& system, const double* x, double* y) {
  kept(system.h.data(), x, y);
  const double* store = system.landmarks.data();
  for (const LandmarkBlock& l : structure.landmarks()) {
    gather(structure, l, x, near_x_.data());
    std::fill_n(near_y_.data(), l.rows, 0.0);
    for (int c = 0; c < l.dim; ++c) {
      const double* w = store + l.w() + std::int64_t{c} * l.rows;
      const double xc = x[l.offset + c];
      double sum = dot(w, near_x_.data(), l.rows);
      for (int k = 0; k < l.dim; ++k)
        sum += store[l.v() + std::max(c, k) + std::int64_t{std::min(c, k)} * l.dim] * x[l.offset + k];
      y[l.offset + c] = sum;
      for (int i = 0; i < l.rows; ++i) near_y_[static_cast<std::size_t>(i)] += w[i] * xc;
    }
    scatter(structure, l, near_y_.data(), y);
  }
}

}  // namespace oriel
