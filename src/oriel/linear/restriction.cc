#include "oriel/linear/restriction.h"

#include <algorithm>

namespace oriel {
namespace {

// x := B x, or Bᵀ x. Sizes that the compiler knows take a third of the time: a graph may be planar as a whole.
template <int N>
void turn_fixed(const double* __restrict B, double* x, std::int64_t stride, bool back) {
  double from[N], to[N] = {};
  for (int i = 0; i < N; ++i) from[i] = x[i * stride];
  if (back)
    for (int i = 0; i < N; ++i)
      for (int k = 0; k < N; ++k) to[i] += B[i * N + k] * from[k];
  else
    for (int k = 0; k < N; ++k)
      for (int i = 0; i < N; ++i) to[i] += B[k * N + i] * from[k];
  for (int i = 0; i < N; ++i) x[i * stride] = to[i];
}

}  // namespace

template <class Kept>
void Restriction::add(const Graph& graph, const Kept& block, bool landmark, std::size_t index) {
  const Freedom& freedom = graph.pools()[block.pool]->freedom(block.dense);
  if (freedom.is_full()) return;
  Block b;
  b.landmark = landmark;
  b.index = static_cast<std::int32_t>(index);
  b.offset = block.offset, b.dim = block.dim;
  b.pool = block.pool, b.dense = block.dense;
  b.freedom = freedom;
  b.axes = axes_.size();
  const auto dim = static_cast<std::size_t>(b.dim);
  if (freedom.axes == Freedom::Axes::world) axes_.resize(axes_.size() + dim * dim);
  if (square_.size() < dim * dim) square_.resize(dim * dim), turned_.resize(dim);
  blocks_.push_back(b);
}

void Restriction::prepare(const Graph& graph, const LinearStructure& structure) {
  if (structure_version_ == structure.version() && freedom_version_ == graph.freedom_version()) return;
  structure_version_ = structure.version(), freedom_version_ = graph.freedom_version();
  blocks_.clear(), rows_.clear(), axes_.clear();
  const auto& pools = graph.pools();
  if (std::all_of(pools.begin(), pools.end(), [](const auto& p) { return p->restricted_count() == 0; })) return;
  const auto& kept = structure.kept();
  const auto& landmarks = structure.landmarks();
  for (std::size_t i = 0; i < kept.size(); ++i) add(graph, kept[i], false, i);
  for (std::size_t i = 0; i < landmarks.size(); ++i) add(graph, landmarks[i], true, i);
  if (!structure.landmark_panel()) find_rows(structure);
}

// One look through the neighbours of all landmarks, sorted by variable.
void Restriction::find_rows(const LinearStructure& structure) {
  block_of_.assign(structure.kept().size(), -1);
  for (std::size_t b = 0; b < blocks_.size(); ++b)
    if (!blocks_[b].landmark) block_of_[static_cast<std::size_t>(blocks_[b].index)] = static_cast<std::int32_t>(b);
  auto for_each = [&](auto&& f) {
    for (std::size_t l = 0; l < structure.landmarks().size(); ++l) {
      const LandmarkBlock& landmark = structure.landmarks()[l];
      std::int32_t row = 0;
      for (int k = 0; k < landmark.neighbours; ++k) {
        const auto kept = static_cast<std::size_t>(structure.neighbours()[landmark.first_neighbour + k]);
        if (block_of_[kept] >= 0)
          f(blocks_[static_cast<std::size_t>(block_of_[kept])], static_cast<std::int32_t>(l), row);
        row += structure.kept()[kept].dim;
      }
    }
  };
  for (Block& b : blocks_) b.first_row = 0;
  for_each([](Block& b, std::int32_t, std::int32_t) { ++b.first_row; });
  std::size_t end = 0;
  for (Block& b : blocks_) end += b.first_row, b.first_row = end;
  rows_.resize(end);
  for_each([this](Block& b, std::int32_t landmark, std::int32_t row) { rows_[--b.first_row] = {landmark, row}; });
}

const Restriction::Block* Restriction::find(int offset) const {
  const auto next =
      std::upper_bound(blocks_.begin(), blocks_.end(), offset, [](int o, const Block& b) { return o < b.offset; });
  return next == blocks_.begin() ? nullptr : &*(next - 1);
}

Freedom Restriction::freedom(int offset) const {
  const Block* b = find(offset);
  return b != nullptr && b->offset == offset ? b->freedom : Freedom::full();
}

bool Restriction::holds(int scalar) const {
  const Block* b = find(scalar);
  return b != nullptr && scalar < b->offset + b->dim && b->freedom.holds(scalar - b->offset);
}

void Restriction::turn(const Block& b, double* x, std::int64_t stride, bool back) {
  const double* B = axes(b);
  if (B == nullptr) return;
  if (b.dim == 3) return turn_fixed<3>(B, x, stride, back);
  if (b.dim == 6) return turn_fixed<6>(B, x, stride, back);
  for (int i = 0; i < b.dim; ++i) {
    double sum = 0.0;
    for (int k = 0; k < b.dim; ++k) sum += B[back ? i * b.dim + k : k * b.dim + i] * x[k * stride];
    turned_[static_cast<std::size_t>(i)] = sum;
  }
  for (int i = 0; i < b.dim; ++i) x[i * stride] = turned_[static_cast<std::size_t>(i)];
}

void Restriction::restrict_vector(const Block& b, double* x, std::int64_t stride) {
  turn(b, x, stride, false);
  for (int i = 0; i < b.dim; ++i)
    if (b.freedom.holds(i)) x[i * stride] = 0.0;
}

// A symmetric block of which the lower half counts.
void Restriction::restrict_diagonal(const Block& b, double* h, std::int64_t ld) {
  const int n = b.dim;
  double* const s = square_.data();
  for (int c = 0; c < n; ++c)
    for (int r = c; r < n; ++r) s[c * n + r] = s[r * n + c] = h[c * ld + r];
  for (int c = 0; c < n; ++c) restrict_vector(b, s + c * n, 1);
  for (int r = 0; r < n; ++r) restrict_vector(b, s + r, n);
  for (int c = 0; c < n; ++c)
    for (int r = c; r < n; ++r) h[c * ld + r] = r == c && b.freedom.holds(c) ? 1.0 : s[c * n + r];
}

void Restriction::restrict_kept(const LinearStructure& structure, const Block& b, LinearSystem& system) {
  double* const h = system.h.data();
  for (const int j : structure.pattern().neighbours(b.index)) {
    const BlockAddress at = structure.address(b.index, j);
    const int columns = structure.kept()[static_cast<std::size_t>(j)].dim;
    for (int c = 0; c < columns; ++c)
      restrict_vector(b, h + at.offset + (at.transposed ? c : std::int64_t{c} * at.ld), at.transposed ? at.ld : 1);
  }
  const BlockAddress at = structure.address(b.index, b.index);
  restrict_diagonal(b, h + at.offset, at.ld);
  auto restrict_rows = [&](const LandmarkBlock& l, std::int32_t row) {
    for (int c = 0; c < l.dim; ++c)
      restrict_vector(b, system.landmarks.data() + l.w() + std::int64_t{c} * l.rows + row, 1);
  };
  if (structure.landmark_panel()) {
    if (b.index < structure.first_seen()) return;
    for (const LandmarkBlock& l : structure.landmarks()) restrict_rows(l, b.offset - structure.first_scalar());
    return;
  }
  const std::size_t end = &b == &blocks_.back() ? rows_.size() : (&b + 1)->first_row;
  for (std::size_t i = b.first_row; i < end; ++i)
    restrict_rows(structure.landmarks()[static_cast<std::size_t>(rows_[i].landmark)], rows_[i].row);
}

void Restriction::restrict_landmark(const LinearStructure& structure, const Block& b, LinearSystem& system) {
  const LandmarkBlock& l = structure.landmarks()[static_cast<std::size_t>(b.index)];
  double* const store = system.landmarks.data();
  restrict_diagonal(b, store + l.v(), l.dim);
  for (int i = 0; i < l.rows; ++i) restrict_vector(b, store + l.w() + i, l.rows);
}

void Restriction::apply(const Graph& graph, const LinearStructure& structure, const Point& point,
                        LinearSystem& system) {
  for (const Block& b : blocks_) {
    if (b.freedom.axes == Freedom::Axes::world)
      graph.pools()[b.pool]->ops().world_axes(point.value(b.pool, b.dense), axes_.data() + b.axes);
    const auto offset = static_cast<std::size_t>(b.offset);
    restrict_vector(b, system.gradient.data() + offset, 1);
    const double* diagonal = nullptr;
    std::int64_t ld = b.dim;
    if (b.landmark) {
      restrict_landmark(structure, b, system);
      diagonal = system.landmarks.data() + structure.landmarks()[static_cast<std::size_t>(b.index)].v();
    } else {
      restrict_kept(structure, b, system);
      const BlockAddress at = structure.address(b.index, b.index);
      diagonal = system.h.data() + at.offset, ld = at.ld;
    }
    for (int k = 0; k < b.dim; ++k) system.diagonal[offset + static_cast<std::size_t>(k)] = diagonal[k * ld + k];
  }
}

void Restriction::to_tangent(double* step) {
  for (const Block& b : blocks_) turn(b, step + b.offset, 1, true);
}

void Restriction::to_tangent(int offset, double* covariance, std::size_t n, std::size_t at) {
  const Block* b = find(offset);
  if (b == nullptr || b->offset != offset) return;
  for (std::size_t c = 0; c < n; ++c) turn(*b, covariance + c * n + at, 1, true);
  for (std::size_t r = 0; r < n; ++r) turn(*b, covariance + at * n + r, static_cast<std::int64_t>(n), true);
}

}  // namespace oriel
