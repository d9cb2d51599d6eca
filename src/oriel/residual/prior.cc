#include "oriel/residual/prior.h"

namespace oriel {

template void linearize_rows<Prior<Pose2d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<Pose2d>, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<Pose2d>, FullNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<Pose3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<Pose3d>, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<Pose3d>, FullNoise<6>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<Velocity3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<Velocity3d>, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<ImuBiasd>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<ImuBiasd>, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<Point3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<Point3d>, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
