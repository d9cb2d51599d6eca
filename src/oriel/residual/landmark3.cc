#include "oriel/residual/landmark3.h"

namespace oriel {

template void linearize_rows<Sighting3d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Sighting3d, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Sighting3d, FullNoise<3>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
