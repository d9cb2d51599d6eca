#include "oriel/residual/bal.h"

namespace oriel {

template void linearize_rows<BalReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
