#include "oriel/residual/sim3.h"

namespace oriel {

template void linearize_rows<Prior<Sim3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Prior<Sim3d>, DiagonalNoise<7>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Between<Sim3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Between<Sim3d>, DiagonalNoise<7>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<Between<Sim3d>, FullNoise<7>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
