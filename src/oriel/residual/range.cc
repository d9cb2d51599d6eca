#include "oriel/residual/range.h"

namespace oriel {

template void linearize_rows<RangeToPointd, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<RangeToBeacond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
