// The reduced system S x = b of landmarks without S: conjugate gradients, each product S p = (H + D) p - Σ W (V + D)⁻¹
// Wᵀ p made landmark by landmark (M. Hestenes, E. Stiefel, 1952; Y. Saad, Iterative Methods for Sparse Linear Systems,
// 2nd edition, 2003, algorithm 9.1; for bundle adjustment S. Agarwal et al., Bundle Adjustment in the Large, 2010,
// §4.2). The preconditioner is the inverse of S's diagonal blocks. For problems whose S is too large to form and
// factor.
#pragma once
#include <vector>

#include "oriel/linear/conjugate_gradient_options.h"
#include "oriel/linear/hessian_product.h"

namespace oriel {

class SchurConjugateGradient {
 public:
  void prepare(const LinearStructure& structure);

  struct Report {
    int iterations = 0;
    bool finite = true;
    int undetermined = 0;  // scalars of landmarks whose (V + D) has no pivot; their part of the step is 0
  };
  // (H + D) step = -gradient, landmarks too.
  Report solve(const LinearStructure& structure, const LinearSystem& system, const HessianProduct& product,
               const double* damping, const ConjugateGradientOptions& options, double* step, TaskPool* pool);

 private:
  void invert_landmarks(const LinearStructure& structure, const LinearSystem& system, const double* damping);
  void make_right_side(const LinearStructure& structure, const LinearSystem& system);
  void make_preconditioner(const LinearStructure& structure, const LinearSystem& system, const double* damping);
  void precondition(const LinearStructure& structure, const double* r, double* z) const;
  void multiply(const LinearStructure& structure, const LinearSystem& system, const HessianProduct& product,
                const double* damping, const double* p, double* out, TaskPool* pool);
  void back_substitute(const LinearStructure& structure, const LinearSystem& system, double* step);

  static constexpr int kSlices = 2;  // of the landmarks, summed in their order whoever computes them
  std::vector<double> inverse_;      // (V + D)⁻¹ of each landmark, kLargest × kLargest doubles each
  std::vector<double> block_;        // inverse diagonal blocks of S, one after the other
  std::vector<std::size_t> block_at_;
  std::vector<double> b_, r_, z_, p_, sp_;
  std::vector<double> near_[kSlices], sum_[kSlices];
  int undetermined_ = 0;
};

}  // namespace oriel
