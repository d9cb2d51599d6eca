// Priors and relative measurements of similarities: r = x ⊟ value and r = Log(measured⁻¹ a⁻¹ b) (7 × 1: rotation [rad],
// translation, logarithm of the scale), as in prior.h and between.h. H. Strasdat, J. Montiel, A. Davison, "Scale
// Drift-Aware Large Scale Monocular SLAM", RSS 2010, closes loops of monocular maps with such edges.
#pragma once
#include "oriel/manifold/sim3.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"

namespace oriel {

// Compiled once, in the library.
extern template void linearize_rows<Prior<Sim3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<Sim3d>, DiagonalNoise<7>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Between<Sim3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Between<Sim3d>, DiagonalNoise<7>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Between<Sim3d>, FullNoise<7>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
