#include "oriel/residual/imu_residual.h"

namespace oriel {

template void linearize_rows<ImuResiduald, FullNoise<15>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
