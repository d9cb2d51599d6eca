#include "oriel/residual/gnss.h"

namespace oriel {

template void linearize_rows<GnssPositiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<GnssPositiond, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<GnssPositiond, FullNoise<3>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
