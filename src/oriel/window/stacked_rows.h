// The same as InformationSum by orthogonal transformations: all absorbed rows stacked, [landmarks | leaving | staying |
// r], brought to echelon form by Householder reflections. Nothing is squared, so information of very different size
// survives side by side (Demmel et al., "Square Root Marginalization for Sliding-Window Bundle Adjustment", ICCV 2021,
// section 4); the price is 2 m n² operations.
#pragma once
#include "oriel/window/absorbed_batch.h"

namespace oriel {

class StackedRows {
 public:
  void begin(const MarginalScope& scope, const MarginalComponent& component, int rows);
  void add(const AbsorbedBatch& batch);
  void add(const AbsorbedPrior& prior);
  void finish(SquareRootRows& out);

 private:
  double* column(int c) { return a_.data() + static_cast<std::size_t>(c) * capacity_; }
  const double* column(int c) const { return a_.data() + static_cast<std::size_t>(c) * capacity_; }
  void copy_rows(int first_row, int rows, int first_column, int columns, std::vector<double>& R,
                 std::vector<double>& d) const;

  const MarginalScope* scope_ = nullptr;
  const MarginalComponent* component_ = nullptr;
  int capacity_ = 0, rows_ = 0;
  std::vector<double> a_;  // capacity × (landmarks + leaving + staying + 1)
  std::vector<char> empty_;
};

}  // namespace oriel
