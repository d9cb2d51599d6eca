// Solution by the factors of a multifrontal factorization: subtrees beside each other, then the top of the tree, and
// back. What subtrees say of rows that they share, those of the top, each says apart; it is added in their order.
#include <algorithm>

#include "oriel/linear/dense_kernels.h"
#include "oriel/linear/multifrontal.h"

namespace oriel {

// v = the values of y at a front's rows, zeros in the padding.
void Multifrontal::load(const Front& f, const double* y, double* v) const {
  std::copy_n(y + f.first_scalar, f.p, v);
  for (const Run& span : symbolic_.spans(f)) std::copy_n(y + span.other, span.length, v + span.row);
  std::fill(v + f.n, v + dense::round_up_8(f.n), 0.0);
}

void Multifrontal::solve_lower(const Front& f, double* y, int worker, TaskPool* pool) {
  double* const v = local_[static_cast<std::size_t>(worker)].data();
  load(f, y, v);
  dense::solve_panel_lower(factor_.data() + f.offset, f.ld, f.n, f.p, inverse_diagonal_.data() + f.first_scalar, v,
                           pool);
  std::copy_n(v, f.p, y + f.first_scalar);
  for (const Run& span : symbolic_.spans(f)) std::copy_n(v + span.row, span.length, y + span.other);
}

void Multifrontal::solve_upper(const Front& f, double* y, int worker, TaskPool* pool) {
  double* const v = local_[static_cast<std::size_t>(worker)].data();
  load(f, y, v);
  dense::solve_panel_upper(factor_.data() + f.offset, f.ld, f.n, f.p, inverse_diagonal_.data() + f.first_scalar, v,
                           pool);
  std::copy_n(v, f.p, y + f.first_scalar);
}

// On a copy of its part of the vector, in which the rows of the top begin with zero.
void Multifrontal::solve_subtree_lower(int subtree, double* y, int worker) {
  const auto fronts = symbolic_.fronts();
  const Symbolic::Subtree& tree = symbolic_.subtrees()[static_cast<std::size_t>(subtree)];
  const Front &first = fronts[static_cast<std::size_t>(tree.first)],
              &last = fronts[static_cast<std::size_t>(tree.last)];
  double* const own = worker_vector_[static_cast<std::size_t>(worker)].data();
  double* const part = subtree_part_.data() + tree.part;
  const int begin = first.first_scalar, count = last.first_scalar + last.p - begin;
  std::copy_n(y + begin, count, own + begin);
  for (const Run& span : symbolic_.spans(last)) std::fill_n(own + span.other, span.length, 0.0);
  for (int i = tree.first; i <= tree.last; ++i) solve_lower(fronts[static_cast<std::size_t>(i)], own, worker, nullptr);
  std::copy_n(own + begin, count, y + begin);
  for (const Run& span : symbolic_.spans(last)) std::copy_n(own + span.other, span.length, part + span.row - last.p);
}

void Multifrontal::solve_lower(double* y, TaskPool* pool) {
  reserve(pool == nullptr ? 1 : pool->workers());
  const auto subtrees = symbolic_.subtrees();
  parallel_for(pool, static_cast<int>(subtrees.size()), [&](int t, int worker) { solve_subtree_lower(t, y, worker); });
  for (const Symbolic::Subtree& tree : subtrees) {
    const Front& last = symbolic_.fronts()[static_cast<std::size_t>(tree.last)];
    for (const Run& span : symbolic_.spans(last))
      for (int i = 0; i < span.length; ++i)
        y[span.other + i] += subtree_part_[static_cast<std::size_t>(tree.part + span.row - last.p + i)];
  }
  for (const Front& f : symbolic_.fronts())
    if (f.task < 0) solve_lower(f, y, 0, pool);
}

void Multifrontal::solve_upper(double* y, TaskPool* pool) {
  reserve(pool == nullptr ? 1 : pool->workers());
  const auto fronts = symbolic_.fronts();
  for (auto i = fronts.size(); i-- > 0;)
    if (fronts[i].task < 0) solve_upper(fronts[i], y, 0, pool);
  const auto subtrees = symbolic_.subtrees();
  parallel_for(pool, static_cast<int>(subtrees.size()), [&](int t, int worker) {
    const Symbolic::Subtree& tree = subtrees[static_cast<std::size_t>(t)];
    for (int i = tree.last; i >= tree.first; --i) solve_upper(fronts[static_cast<std::size_t>(i)], y, worker, nullptr);
  });
}

}  // namespace oriel
