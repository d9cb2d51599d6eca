#include "oriel/residual/landmark2.h"

namespace oriel {

template void linearize_rows<Sighting2d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Sighting2d, DiagonalNoise<2>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Sighting2d, FullNoise<2>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Bearing2d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Range2d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<BearingRange2d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<BearingRange2d, DiagonalNoise<2>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<BearingRange2d, FullNoise<2>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
