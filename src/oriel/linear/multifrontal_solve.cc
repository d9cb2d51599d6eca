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
  const auto members = symbolic_.fronts_of(tree);
  const Front& root = fronts[static_cast<std::size_t>(members.back())];
  double* const own = worker_vector_[static_cast<std::size_t>(worker)].data();
  double* const part = subtree_part_.data() + tree.part;
  auto copy_pivots = [&](const double* from, double* to) {
    for (const int i : members) {
      const Front& f = fronts[static_cast<std::size_t>(i)];
      std::copy_n(from + f.first_scalar, f.p, to + f.first_scalar);
    }
  };
  copy_pivots(y, own);
  for (const Run& span : symbolic_.spans(root)) std::fill_n(own + span.other, span.length, 0.0);
  for (const int i : members) solve_lower(fronts[static_cast<std::size_t>(i)], own, worker, nullptr);
  copy_pivots(own, y);
  for (const Run& span : symbolic_.spans(root)) std::copy_n(own + span.other, span.length, part + span.row - root.p);
}

void Multifrontal::solve_lower(double* y, TaskPool* pool) {
  reserve(pool == nullptr ? 1 : pool->workers());
  const auto fronts = symbolic_.fronts();
  const auto subtrees = symbolic_.subtrees();
  parallel_for(pool, static_cast<int>(subtrees.size()), [&](int t, int worker) { solve_subtree_lower(t, y, worker); });
  for (const Symbolic::Subtree& tree : subtrees) {
    const Front& root = fronts[static_cast<std::size_t>(symbolic_.fronts_of(tree).back())];
    for (const Run& span : symbolic_.spans(root))
      for (int i = 0; i < span.length; ++i)
        y[span.other + i] += subtree_part_[static_cast<std::size_t>(tree.part + span.row - root.p + i)];
  }
  for (const int i : symbolic_.sequence())
    if (fronts[static_cast<std::size_t>(i)].task < 0) solve_lower(fronts[static_cast<std::size_t>(i)], y, 0, pool);
}

void Multifrontal::solve_upper(double* y, TaskPool* pool) {
  reserve(pool == nullptr ? 1 : pool->workers());
  const auto fronts = symbolic_.fronts();
  const auto sequence = symbolic_.sequence();
  for (auto k = sequence.size(); k-- > 0;)
    if (const Front& f = fronts[static_cast<std::size_t>(sequence[k])]; f.task < 0) solve_upper(f, y, 0, pool);
  const auto subtrees = symbolic_.subtrees();
  parallel_for(pool, static_cast<int>(subtrees.size()), [&](int t, int worker) {
    const auto members = symbolic_.fronts_of(subtrees[static_cast<std::size_t>(t)]);
    for (auto k = members.size(); k-- > 0;)
      solve_upper(fronts[static_cast<std::size_t>(members[k])], y, worker, nullptr);
  });
}

}  // namespace oriel
