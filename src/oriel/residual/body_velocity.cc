#include "oriel/residual/body_velocity.h"

namespace oriel {

template void linearize_rows<BodyVelocityd, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<BodyVelocityd, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<BodyVelocityd, FullNoise<3>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
