// Is it the global optimum? A lower bound of what any poses can cost, for pose graphs whose noise is isotropic (D.
// Rosen, L. Carlone, A. Bandeira, J. Leonard, "SE-Sync: A certifiably correct algorithm for synchronization over the
// special Euclidean group", IJRR 2019, problem 2 and theorem 7; all poses stay in it here, translations too).
//
// With poses (t_i, R_i) and edges that measure (t̃, R̃) with precisions τ, κ,
//   F = ½ Σ κ ‖R_j - R_i R̃‖² + τ ‖t_j - t_i - R_i t̃‖²  =  ½ tr(X M Xᵀ),   X = [t_1 R_1 .. t_n R_n].
// For any symmetric Λ_i, with S = M - blockdiag(0, Λ_i) and any η ≥ 0 for which S + η blockdiag(0, I) ≥ 0,
//   F(Y) = ½ tr(Y S Yᵀ) + ½ Σ tr Λ_i  ≥  ½ Σ tr Λ_i - ½ η n D   for all poses Y,
// because RᵀR = I. Λ_i = sym(R_iᵀ ∂F/∂R_i) makes X S = 0 at a stationary point, and then ½ Σ tr Λ_i = F(X). Whether a
// matrix is positive is asked of a Cholesky factorization, so the bound holds up to its rounding.
#pragma once
#include <vector>

#include "oriel/base/result.h"
#include "oriel/io/g2o.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"

namespace oriel {

// An edge with isotropic noise. D = 2 or 3.
template <int D>
struct IsotropicEdge {
  int from = 0, to = 0;  // places of poses
  Mat<double, D, D> R;   // R_from_to
  Vec<double, D> t;      // [m], in the frame of `from`
  double kappa = 0.0;    // κ = 1 / (2 σ²) of the rotation [1/rad²]
  double tau = 0.0;      // τ = 1 / σ² of the translation [1/m²]
};

// The edges of a file, each with the isotropic precisions of the same mean variance: τ = D / tr(Ω_t⁻¹), κ = D' / (2
// tr(Ω_r⁻¹)), D' = 1 or 3, of the diagonal blocks Ω of its information. Refused: a graph with landmarks, an edge whose
// blocks are singular.
Result<std::vector<IsotropicEdge<2>>> isotropic_edges2(const PoseGraphFile& file);
Result<std::vector<IsotropicEdge<3>>> isotropic_edges3(const PoseGraphFile& file);

struct Certificate {
  double cost = 0.0;         // F of the poses, once they are a stationary point of F
  double lower_bound = 0.0;  // F of no poses is less; -HUGE_VAL: none was found
  bool stationary = false;   // the solve that led there converged
  // How far above the global optimum the poses may lie at most, relative.
  double gap() const { return cost > 0.0 ? (cost - lower_bound) / cost : lower_bound < 0.0 ? HUGE_VAL : 0.0; }
  static constexpr double kCertain = 1e-6;
  bool certified() const { return gap() <= kCertain; }
};

// From these poses to the stationary point of F nearby (the minimizer of this library), and the bound there. `poses`
// are those of that point afterwards.
Certificate certify(std::vector<Pose2d>& poses, const std::vector<IsotropicEdge<2>>& edges);
Certificate certify(std::vector<Pose3d>& poses, const std::vector<IsotropicEdge<3>>& edges);

}  // namespace oriel
