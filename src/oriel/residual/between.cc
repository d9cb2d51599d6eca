#include "oriel/residual/between.h"

namespace oriel {

template void linearize_rows<Between<Pose2d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Between<Pose2d>, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Between<Pose2d>, FullNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Between<Pose3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Between<Pose3d>, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Between<Pose3d>, FullNoise<6>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Between<ImuBiasd>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Between<ImuBiasd>, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
