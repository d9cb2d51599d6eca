// Landmarks are eliminated before anything else (Triggs et al., "Bundle Adjustment: A Modern Synthesis", 2000, §6.1):
//   S = H - Σ W (V + D)⁻¹ Wᵀ,   b' = b - Σ W (V + D)⁻¹ b_l,   x_l = (V + D)⁻¹ (b_l - Wᵀ x).
// Two ways to the same sums, chosen by their flops: block by block, or — where most landmarks are seen by most kept
// variables, as in a window — all landmarks as columns of one tall matrix Z = W L⁻ᵀ, and one symmetric product.
#pragma once
#include <vector>

#include "oriel/linear/linearize.h"

namespace oriel {

class LandmarkSchur {
 public:
  // Decides how, and sizes the workspace. Once a structure.
  void prepare(const LinearStructure& structure);

  // S (the layout of H) and the reduced right-hand side; b = -gradient (kept, then landmarks), damping by scalar.
  void reduce(const LinearStructure& structure, const LinearSystem& system, const double* damping, double* s,
              double* rhs, TaskPool* pool);
  // Landmark part of the step, from its kept part.
  void back_substitute(const LinearStructure& structure, const LinearSystem& system, const double* damping,
                       double* step, TaskPool* pool);

  // Scalars of landmarks that nothing determines at the last reduce: their component of the step is 0.
  const std::vector<int>& undetermined() const { return undetermined_; }

 private:
  void reduce_slice(const LinearStructure& structure, const LinearSystem& system, const double* damping, int slice,
                    double* s, double* rhs);
  void subtract_pairs(const LinearStructure& structure, const LandmarkBlock& landmark, const double* z,
                      double* s) const;
  void reduce_panel(const LinearStructure& structure, const LinearSystem& system, const double* damping, double* s,
                    double* rhs);
  static void substitute(const LinearStructure& structure, const LandmarkBlock& landmark, const LinearSystem& system,
                         const double* damping, double* gathered, double* step);
  void subtract_panel(const LinearStructure& structure, double* s, double* rhs);

  int slices_ = 1, largest_ = 0;  // largest_: [doubles] of Z and Z y of a landmark
  std::vector<int> cuts_;         // landmarks of slice k: [cuts_[k], cuts_[k + 1])
  AlignedBuffer panel_, product_, slice_s_;
  std::vector<std::vector<double>> slice_rhs_, slice_z_;  // slice_z_: also one a worker
  std::vector<std::vector<int>> slice_undetermined_;
  std::vector<int> undetermined_;
};

}  // namespace oriel
