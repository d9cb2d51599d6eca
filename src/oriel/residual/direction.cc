#include "oriel/residual/direction.h"

namespace oriel {

template void linearize_rows<DirectionToPointd, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
