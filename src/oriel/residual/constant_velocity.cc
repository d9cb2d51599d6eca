#include "oriel/residual/constant_velocity.h"

namespace oriel {

template void linearize_rows<ConstantVelocityd, FullNoise<9>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
