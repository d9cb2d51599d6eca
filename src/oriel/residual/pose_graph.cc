#include "oriel/residual/pose_graph.h"

namespace oriel {

template void linearize_rows<PoseGraphEdge2d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<PoseGraphEdge2d, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<PoseGraphEdge2d, FullNoise<3>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<PoseGraphEdge3d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<PoseGraphEdge3d, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<PoseGraphEdge3d, FullNoise<6>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<PoseGraphEdgeLog3d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<PoseGraphEdgeLog3d, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<PoseGraphEdgeLog3d, FullNoise<6>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
