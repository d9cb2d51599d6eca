// BlockMatrix: a sparse symmetric matrix of blocks that are named by ids of variables, for looking at a linear system
// and for small algebra on it (adding two, removing a variable, products). The solver itself works on the layout of
// its factorization; `hessian` copies from there.
#pragma once
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "oriel/base/matrix.h"
#include "oriel/base/result.h"
#include "oriel/graph/ids.h"

namespace oriel {

class LinearStructure;
class Graph;
struct LinearSystem;

class BlockMatrix {
 public:
  // A variable without blocks, after all others. A contract: it is not there yet, dim >= 1.
  void add_variable(VariableKey id, int dim);
  template <Manifold V>
  void add_variable(VariableId<V> id) {
    add_variable(VariableKey(id), V::kDim);
  }
  // Its row and column leave; false if it is not there.
  bool remove_variable(VariableKey id);
  bool contains(VariableKey id) const { return find(id) >= 0; }
  // First scalar and dimension of a variable that is there, by the order of coming.
  int offset(VariableKey id) const { return rows_[at(id)].offset; }
  int dim(VariableKey id) const { return rows_[at(id)].dim; }
  int dim() const { return rows_.empty() ? 0 : rows_.back().offset + rows_.back().dim; }
  std::vector<VariableKey> variables() const;
  std::size_t block_count() const;  // stored ones; (i, j) and (j, i) are one

  // Block (i, j), V::kDim × W::kDim; block (j, i) is its transpose at once. Of a diagonal block the lower half counts.
  template <Manifold V, Manifold W>
  void set(VariableId<V> i, VariableId<W> j, const Mat<double, V::kDim, W::kDim>& block) {
    set(VariableKey(i), VariableKey(j), std::span<const double>(block.m));
  }
  // Nothing where no block was ever set.
  template <Manifold V, Manifold W>
  std::optional<Mat<double, V::kDim, W::kDim>> get(VariableId<V> i, VariableId<W> j) const {
    Mat<double, V::kDim, W::kDim> block;
    if (!get(VariableKey(i), VariableKey(j), std::span<double>(block.m))) return std::nullopt;
    return block;
  }
  // The same without types; numbers are column-major.
  void set(VariableKey i, VariableKey j, std::span<const double> block);
  bool get(VariableKey i, VariableKey j, std::span<double> block) const;

  // Numbers become 0, blocks stay.
  void set_zero();
  // Y = A X; X and Y are dim() × columns, column-major, and apart.
  void multiply(std::span<const double> x, int columns, std::span<double> y) const;
  // This += other. An error, and nothing done, if `other` has a variable that is not here or has another dimension.
  Result<void> add(const BlockMatrix& other);

 private:
  using Code = std::tuple<std::uint64_t, std::uint32_t, std::uint32_t>;
  struct Block {
    VariableKey column;  // of a variable that came before or is the same
    std::vector<double> numbers;
  };
  struct Row {
    VariableKey id;
    int dim = 0, offset = 0;
    std::map<Code, Block> blocks;
  };
  static Code code(VariableKey id) { return {id.type, id.key.index, id.key.generation}; }
  int find(VariableKey id) const;
  std::size_t at(VariableKey id) const;
  // The block in the lower half, made if need be.
  std::vector<double>& lower(std::size_t row, std::size_t column);

  std::vector<Row> rows_;
  std::map<Code, int> index_;
};

// H of a linear system, landmarks included.
BlockMatrix hessian(const Graph& graph, const LinearStructure& structure, const LinearSystem& system);

}  // namespace oriel
