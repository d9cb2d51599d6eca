// Multifrontal Cholesky factorization of a symmetric block matrix, H + diag(damping) = L Lᵀ (I. Duff, J. Reid, "The
// multifrontal solution of indefinite sparse symmetric linear equations", ACM TOMS 9, 1983; J. Liu, SIAM Review 1992).
//
//   pattern.reset(dims), pattern.connect(...), pattern.finish();
//   factorization.analyze(pattern, {});                            // once a structure
//   H[0 .. storage_size()) = 0; blocks added at address(i, j);      // once a linearization
//   factorization.factor(H, damping);                              // once a trial: H is not changed
//   factorization.solve(b, x);
//
// factor and solve allocate nothing from their second call on, throw nothing, and give the same bits for any pool.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/linear/aligned_buffer.h"
#include "oriel/linear/block_pattern.h"
#include "oriel/linear/ordering.h"
#include "oriel/linear/symbolic.h"
#include "oriel/linear/task_pool.h"

namespace oriel {

struct FactorOptions {
  LinearSolver linear_solver = LinearSolver::direct;
  OrderingMethod ordering = OrderingMethod::automatic;
  // A pivot at or below this share of its diagonal entry of H + damping is undetermined.
  double relative_pivot = 1e-13;
  // `automatic` tries nested dissection as well where minimum degree leaves more work than this [flop].
  // Measured: on torus3D (1.2e9) METIS takes 12 ms and saves 1.3 ms of a 35 ms factorization, which does not pay.
  double dissection_flops = 3e9;
  // Blocks from here on are eliminated last by minimum degree (linear/ordering.h).
  int first_late = MinimumDegree::kNoneLate;
  // Kept variables from which on a structure without landmarks keeps its elimination order, and follows its graph.
  std::size_t least_followed = 20'000;
};

struct FactorReport {
  enum class Status { ok, undetermined, not_finite };
  struct Scalar {
    int block = -1, row = -1;  // row within the block
  };
  Status status = Status::ok;
  // Scalars that nothing determines, given all that are eliminated before: their component of a solution is 0.
  int undetermined_count = 0;
  std::array<Scalar, 32> undetermined{};  // the first of them, in elimination order
  Scalar not_finite{};                    // the first pivot that is not finite
  double smallest_ratio = 1.0;            // pivot / diagonal entry, over the determined pivots
  Scalar smallest{};                      // where
};

class Multifrontal {
 public:
  // Orders the blocks and lays out fronts and addresses. `given` is used by OrderingMethod::given alone: a permutation
  // of the blocks. An error names a dimension below 1 or what is wrong with `given`. All of it is a function of what it
  // is given, so that where this is what it was, what was found is kept.
  Result<void> analyze(const BlockPattern& pattern, const FactorOptions& options, std::span<const int> given = {});

  // For a pattern that differs from the last one as Symbolic::update has it; with the bits of analyze(pattern, given,
  // order). Nothing is checked.
  void follow(const BlockPattern& pattern, const FactorOptions& options, std::span<const int> order,
              std::span<const int> changed);

  const Symbolic& symbolic() const { return symbolic_; }
  void set_relative_pivot(double relative_pivot) { relative_pivot_ = relative_pivot; }
  std::int64_t analyses() const { return analyses_; }                     // how often everything was found anew
  std::int64_t updates() const { return updates_; }                       // how often what a change reached was
  std::int64_t storage_size() const { return symbolic_.storage_size(); }  // [doubles] of H
  BlockAddress address(int i, int j) const { return symbolic_.address(i, j); }
  bool has(int i, int j) const { return symbolic_.has(i, j); }

  // H: storage_size() doubles, zero but for the blocks written at address(i, j); of a diagonal block only the lower
  // triangle is read. damping: one value >= 0 for each scalar, in the order of the input, or null.
  const FactorReport& factor(const double* h, const double* damping = nullptr, TaskPool* pool = nullptr);
  const FactorReport& report() const { return report_; }

  // (H + diag(damping)) x = b; both in the order of the input, and may be the same. Meaningful unless not_finite.
  void solve(const double* b, double* x, TaskPool* pool = nullptr);

  // The halves: vectors y in elimination order (symbolic().scalar(block)), total_dim() values.
  void to_elimination_order(const double* b, double* y) const;
  void from_elimination_order(const double* y, double* x) const;
  void solve_lower(double* y, TaskPool* pool = nullptr);  // y := L⁻¹ y
  void solve_upper(double* y, TaskPool* pool = nullptr);  // y := L⁻ᵀ y

  // 1/L_jj in elimination order, 0 where undetermined.
  std::span<const double> inverse_diagonal() const { return inverse_diagonal_; }
  // The pivot columns of L, front by front: symbolic().fronts().
  const double* factor_data() const { return factor_.data(); }

 private:
  bool is_known(const BlockPattern& pattern, const FactorOptions& options, std::span<const int> given) const;
  void order_blocks(const BlockPattern& pattern, const FactorOptions& options, std::span<const int> given);
  void reserve(int workers);
  void factor_front(int front, const double* h, const double* damping, int worker, TaskPool* pool);
  void copy_pivots(const Front& front, const double* h, const double* damping);
  void assemble(int front, int worker, double* to, std::int64_t ld, int begin, int end);
  double* update_of(int front, int worker);
  void make_report();
  FactorReport::Scalar locate(const Front& front, int scalar) const;
  void prepare_vectors();
  void load(const Front& front, const double* y, double* v) const;
  void solve_lower(const Front& front, double* y, int worker, TaskPool* pool);
  void solve_upper(const Front& front, double* y, int worker, TaskPool* pool);
  void solve_subtree_lower(int subtree, double* y, int worker);

  Symbolic symbolic_;
  MinimumDegree minimum_degree_;
  std::vector<int> ordering_, other_ordering_;
  Symbolic other_symbolic_;
  double relative_pivot_ = 0.0;
  // What the analysis at hand is of.
  BlockPattern analyzed_;
  OrderingMethod analyzed_ordering_ = OrderingMethod::given;
  double analyzed_dissection_flops_ = 0.0;
  int analyzed_first_late_ = MinimumDegree::kNoneLate;
  std::vector<int> analyzed_order_;
  std::int64_t analyses_ = 0, updates_ = 0;

  AlignedBuffer factor_, shared_arena_;
  std::vector<AlignedBuffer> task_arenas_, local_;  // one a worker; local_: a vector over a front's rows
  // A vector in elimination order for each worker; and what each subtree takes from the rows of its root that are not
  // pivots, added in the order of subtrees.
  std::vector<AlignedBuffer> worker_vector_;
  std::vector<double> subtree_part_;
  // In elimination order, one value a scalar.
  std::vector<double> diagonal_, threshold_, inverse_diagonal_, vector_;
  FactorReport report_;
};

}  // namespace oriel
