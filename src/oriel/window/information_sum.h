// The sum of absorbed factors as an information matrix, H = Σ JᵀJ and g = Σ Jᵀr of one component, from which landmarks
// are taken away chunk by chunk (Schur complement), then the leaving variables by the first steps of one Cholesky
// factorization; its other steps are the rows of the prior's R. Where H is near to singular, pivots are chosen by size:
// R is then triangular up to the order of its columns, and the last pivot bounds what was left out.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/linear/aligned_buffer.h"
#include "oriel/linear/prior_product.h"
#include "oriel/window/absorbed_batch.h"
#include "oriel/window/run_products.h"

namespace oriel {

class InformationSum {
 public:
  // A pivot at or below this share of what was summed on the diagonal is rounding error: nothing determines it.
  static constexpr double kRelativePivot = 2e-14;

  // Above this share pivots need not be chosen by size.
  static constexpr double kSafePivot = 1e-8;
  // Of H with a unit diagonal: some hundred sums' rounding error.
  static constexpr double kRounding = 1e-14;

  void begin(const MarginalScope& scope, const MarginalComponent& component);
  void add(const AbsorbedBatch& batch);
  void add(const AbsorbedPrior& prior);
  // Takes away the landmarks of a chunk, all of whose rows were added.
  void eliminate_landmarks(int chunk);
  // R and d of what stays, about the point of linearization.
  void finish(SquareRootRows& out);

 private:
  struct Run;  // rows of a batch that touch the same variables, landmarks apart
  void lay_out(const AbsorbedBatch& batch, int lane);
  void add_products(const Batch& batch, int begin, int end);
  void scale();
  bool factor_at_once();
  void step(int p, int block);
  void eliminate(int begin, int end);
  void forget_rounding(int first_row, int begin);
  void write_rows(int first_row, int rows, int first_column, std::vector<double>& R, std::vector<double>& d) const;
  void add_landmarks(const AbsorbedBatch& batch, int begin, int end);
  double* at(int row, int column) { return h_.data() + static_cast<std::int64_t>(column) * ld_ + row; }

  const MarginalScope* scope_ = nullptr;
  const MarginalComponent* component_ = nullptr;
  int n_ = 0, ld_ = 0, panel_ld_ = 0;
  PriorProduct prior_product_;
  RunProducts products_;
  AlignedBuffer h_, panel_, g_, factor_, scale_, active_;
  int steps_ = 0;  // rows of the factor so far
  std::vector<double> landmark_v_, landmark_g_, taken_, right_, diagonal_, threshold_, inverse_, roots_;
  std::vector<UndeterminedColumn> undetermined_;

  // Of the run at hand: columns of J and where they go; the landmark's columns.
  std::vector<int> columns_, targets_;
  int landmark_arg_ = -1, landmark_column_ = 0, landmark_dim_ = 0;
};

}  // namespace oriel
