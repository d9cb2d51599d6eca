#include "oriel/residual/matched_point.h"

namespace oriel {

template void linearize_rows<MatchedPixeld, FullNoise<2>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<MatchedDisparityd, FullNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<MatchedStereod, FullNoise<4>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
