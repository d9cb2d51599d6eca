#include "oriel/residual/registration.h"

namespace oriel {

template void linearize_rows<PointToPointd, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<PointToPointd, FullNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<PointToPlaned, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<PointToLined, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
