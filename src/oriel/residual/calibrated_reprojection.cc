#include "oriel/residual/calibrated_reprojection.h"

namespace oriel {

template void linearize_rows<CalibratedReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
