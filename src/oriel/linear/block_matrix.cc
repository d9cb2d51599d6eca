#include "oriel/linear/block_matrix.h"

#include <algorithm>

#include "oriel/linear/linearize.h"

namespace oriel {

void BlockMatrix::add_variable(VariableKey id, int dim) {
  check(find(id) < 0 && dim >= 1, "BlockMatrix::add_variable: it is there already, or has no dimension");
  index_[code(id)] = static_cast<int>(rows_.size());
  const int offset = this->dim();
  rows_.push_back({id, dim, offset, {}});
}

bool BlockMatrix::remove_variable(VariableKey id) {
  const int gone = find(id);
  if (gone < 0) return false;
  rows_.erase(rows_.begin() + gone);
  index_.erase(code(id));
  int offset = 0;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    rows_[i].blocks.erase(code(id));
    rows_[i].offset = offset;
    offset += rows_[i].dim;
    index_[code(rows_[i].id)] = static_cast<int>(i);
  }
  return true;
}

std::vector<VariableKey> BlockMatrix::variables() const {
  std::vector<VariableKey> ids;
  for (const Row& r : rows_) ids.push_back(r.id);
  return ids;
}

std::size_t BlockMatrix::block_count() const {
  std::size_t n = 0;
  for (const Row& r : rows_) n += r.blocks.size();
  return n;
}

int BlockMatrix::find(VariableKey id) const {
  const auto found = index_.find(code(id));
  return found == index_.end() ? -1 : found->second;
}

std::size_t BlockMatrix::at(VariableKey id) const {
  const int i = find(id);
  check(i >= 0, "BlockMatrix: a variable that is not there");
  return static_cast<std::size_t>(i);
}

std::vector<double>& BlockMatrix::lower(std::size_t row, std::size_t column) {
  Block& b = rows_[row].blocks[code(rows_[column].id)];
  if (b.numbers.empty()) {
    b.column = rows_[column].id;
    b.numbers.assign(static_cast<std::size_t>(rows_[row].dim) * static_cast<std::size_t>(rows_[column].dim), 0.0);
  }
  return b.numbers;
}

void BlockMatrix::set(VariableKey i, VariableKey j, std::span<const double> block) {
  const std::size_t a = at(i), b = at(j), rows = static_cast<std::size_t>(rows_[a].dim),
                    columns = static_cast<std::size_t>(rows_[b].dim);
  check(block.size() == rows * columns, "BlockMatrix::set: a block of another size");
  std::vector<double>& numbers = lower(std::max(a, b), std::min(a, b));
  for (std::size_t c = 0; c < columns; ++c)
    for (std::size_t r = 0; r < rows; ++r) {
      if (a == b) numbers[std::min(r, c) * rows + std::max(r, c)] = block[std::min(r, c) * rows + std::max(r, c)];
      if (a == b) numbers[std::max(r, c) * rows + std::min(r, c)] = block[std::min(r, c) * rows + std::max(r, c)];
      if (a > b) numbers[c * rows + r] = block[c * rows + r];
      if (a < b) numbers[r * columns + c] = block[c * rows + r];
    }
}

bool BlockMatrix::get(VariableKey i, VariableKey j, std::span<double> block) const {
  const std::size_t a = at(i), b = at(j), rows = static_cast<std::size_t>(rows_[a].dim),
                    columns = static_cast<std::size_t>(rows_[b].dim);
  check(block.size() == rows * columns, "BlockMatrix::get: a block of another size");
  const auto found = rows_[std::max(a, b)].blocks.find(code(a > b ? j : i));
  if (found == rows_[std::max(a, b)].blocks.end()) return false;
  const std::vector<double>& numbers = found->second.numbers;
  for (std::size_t c = 0; c < columns; ++c)
    for (std::size_t r = 0; r < rows; ++r)
      block[c * rows + r] = a >= b ? numbers[c * rows + r] : numbers[r * columns + c];
  return true;
}

void BlockMatrix::set_zero() {
  for (Row& row : rows_)
    for (auto& [key, block] : row.blocks) std::fill(block.numbers.begin(), block.numbers.end(), 0.0);
}

void BlockMatrix::multiply(std::span<const double> x, int columns, std::span<double> y) const {
  const auto n = static_cast<std::size_t>(dim());
  check(x.size() == n * static_cast<std::size_t>(columns) && y.size() == x.size(),
        "BlockMatrix::multiply: wrong sizes");
  std::fill(y.begin(), y.end(), 0.0);
  for (const Row& row : rows_)
    for (const auto& [key, block] : row.blocks) {
      const Row& other = rows_[at(block.column)];
      for (std::size_t k = 0; k < static_cast<std::size_t>(columns); ++k)
        for (int c = 0; c < other.dim; ++c)
          for (int r = 0; r < row.dim; ++r) {
            const double a = block.numbers[static_cast<std::size_t>(c) * static_cast<std::size_t>(row.dim) +
                                           static_cast<std::size_t>(r)];
            const std::size_t i = k * n + static_cast<std::size_t>(row.offset + r),
                              j = k * n + static_cast<std::size_t>(other.offset + c);
            y[i] += a * x[j];
            if (&row != &other) y[j] += a * x[i];
          }
    }
}

Result<void> BlockMatrix::add(const BlockMatrix& other) {
  for (const Row& row : other.rows_)
    if (!contains(row.id) || dim(row.id) != row.dim)
      return Error{ErrorCode::size_mismatch, "BlockMatrix::add: variable #" + std::to_string(row.id.key.index) + "." +
                                                 std::to_string(row.id.key.generation) +
                                                 " is not in the sum, or has another dimension there"};
  for (const Row& row : other.rows_)
    for (const auto& [key, block] : row.blocks) {
      const std::size_t a = at(row.id), b = at(block.column), rows = static_cast<std::size_t>(row.dim);
      std::vector<double>& sum = lower(std::max(a, b), std::min(a, b));
      const std::size_t columns = block.numbers.size() / rows;
      for (std::size_t c = 0; c < columns; ++c)
        for (std::size_t r = 0; r < rows; ++r)
          sum[a >= b ? c * rows + r : r * columns + c] += block.numbers[c * rows + r];
    }
  return {};
}

namespace {

VariableKey key_of(const Graph& graph, std::uint32_t pool, std::uint32_t dense) {
  const VariablePool& p = *graph.pools()[pool];
  return {p.ops().key, p.slots().key(dense)};
}

// Block `at` of H, rows × columns; of a diagonal block the lower half alone is meant.
std::vector<double> copy_block(const double* h, const BlockAddress& at, int rows, int columns) {
  std::vector<double> block;
  for (int c = 0; c < columns; ++c)
    for (int r = 0; r < rows; ++r)
      block.push_back(h[at.offset + (at.transposed ? std::int64_t{r} * at.ld + c : std::int64_t{c} * at.ld + r)]);
  return block;
}

}  // namespace

BlockMatrix hessian(const Graph& graph, const LinearStructure& structure, const LinearSystem& system) {
  BlockMatrix h;
  std::vector<VariableKey> ids;
  for (const KeptBlock& b : structure.kept()) h.add_variable(ids.emplace_back(key_of(graph, b.pool, b.dense)), b.dim);
  for (std::size_t i = 0; i < ids.size(); ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      const int a = static_cast<int>(i), b = static_cast<int>(j);
      if (!structure.factorization().has(a, b)) continue;
      h.set(ids[i], ids[j], copy_block(system.h.data(), structure.address(a, b), h.dim(ids[i]), h.dim(ids[j])));
    }
  for (const LandmarkBlock& l : structure.landmarks()) {
    const VariableKey id = key_of(graph, l.pool, l.dense);
    const double* data = system.landmarks.data();
    h.add_variable(id, l.dim);
    h.set(id, id, std::span(data + l.v(), static_cast<std::size_t>(l.dim) * static_cast<std::size_t>(l.dim)));
    std::int64_t row = 0;  // of W: blocks stand one after the other, or where the panel has them
    for (int k = 0; k < l.neighbours; ++k) {
      const int at = structure.neighbours()[static_cast<std::size_t>(l.first_neighbour) + static_cast<std::size_t>(k)];
      const VariableKey kept = ids[static_cast<std::size_t>(at)];
      if (structure.landmark_panel())
        row = structure.kept()[static_cast<std::size_t>(at)].offset - structure.first_scalar();
      h.set(kept, id, copy_block(data + l.w(), {row, l.rows, false}, h.dim(kept), l.dim));
      row += h.dim(kept);
    }
  }
  return h;
}

}  // namespace oriel
