// The linear problem where directions of some variables are held (graph/freedom.h).
//
// With d = Bᵀ y for each restricted variable, y being its step in the axes in which directions are named, H becomes
// B H Bᵀ and g becomes B g (the other variables have B = I). Then rows and columns of held scalars are cleared, with 1
// on the diagonal and 0 in g, so that whatever solves the system finds exactly 0 for them, damped or not, and the rest
// of y as if their columns had never been there. That is H ← P H P + (I - P), g ← P g of P = Bᵀ M B in the axes where P
// is diagonal; J. Nocedal, S. Wright, "Numerical Optimization", 2nd ed., section 16.2, calls it the null-space method.
// All that follows assembly (damping, elimination of landmarks, factorization, conjugate gradients, products, the look
// for undetermined directions) works on y, and `to_tangent` takes what it finds back to d.
//
// Held landmarks stay eliminated: their V and W are treated alike. A freedom changes numbers, never the layout.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/linear/linearize.h"

namespace oriel {

class Restriction {
 public:
  // Who is restricted; looks only where the structure or a freedom has changed.
  void prepare(const Graph& graph, const LinearStructure& structure);
  bool empty() const { return blocks_.empty(); }

  // Brings a system, just assembled, into this form; B at the point that the step will leave from. Costs the blocks of
  // the variables that are restricted.
  void apply(const Graph& graph, const LinearStructure& structure, const Point& point, LinearSystem& system);
  // d = Bᵀ y, of dim() values; B as at the last `apply`.
  void to_tangent(double* step);
  // Σ_d = Bᵀ Σ_y B of the rows and columns [at, at + dimension) of n × n, for the variable at this offset in a step.
  void to_tangent(int offset, double* covariance, std::size_t n, std::size_t at);

  // Of the variable at this offset in a step, or the scalar.
  Freedom freedom(int offset) const;
  bool holds(int scalar) const;

 private:
  struct Block {
    bool landmark = false;
    std::int32_t index = 0, offset = 0, dim = 0;  // of the kept block or landmark; in a step
    std::uint32_t pool = 0, dense = 0;
    Freedom freedom;
    std::size_t axes = 0;       // of B in axes_
    std::size_t first_row = 0;  // in rows_, up to that of the next block
  };
  // Rows of a landmark's W that belong to a restricted kept variable.
  struct Rows {
    std::int32_t landmark = 0, row = 0;
  };
  template <class Kept>
  void add(const Graph& graph, const Kept& block, bool landmark, std::size_t index);
  void find_rows(const LinearStructure& structure);
  const Block* find(int offset) const;  // whose scalars begin there or before; null: none
  const double* axes(const Block& b) const {
    return b.freedom.axes == Freedom::Axes::world ? axes_.data() + b.axes : nullptr;
  }
  void turn(const Block& b, double* x, std::int64_t stride, bool back);
  void restrict_vector(const Block& b, double* x, std::int64_t stride);
  void restrict_diagonal(const Block& b, double* h, std::int64_t ld);
  void restrict_kept(const LinearStructure& structure, const Block& b, LinearSystem& system);
  void restrict_landmark(const LinearStructure& structure, const Block& b, LinearSystem& system);

  std::vector<Block> blocks_;  // in the order of their offsets
  std::vector<Rows> rows_;
  std::vector<double> axes_, square_;
  std::vector<double> turned_;
  std::vector<std::int32_t> block_of_;  // by kept block, -1: not restricted
  std::uint64_t structure_version_ = ~std::uint64_t{0}, freedom_version_ = ~std::uint64_t{0};
};

}  // namespace oriel
