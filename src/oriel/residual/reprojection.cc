#include "oriel/residual/reprojection.h"

namespace oriel {

template void linearize_rows<StereoReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<MonoReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<MonoReprojection<double, 1>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<AnchorReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<StereoPointReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<MonoPointReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<MonoPointReprojection<double, 1>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
