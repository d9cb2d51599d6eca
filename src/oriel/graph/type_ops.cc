#include "oriel/graph/type_ops.h"

namespace oriel {

template void detail::plus_all<Rot2d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
template void detail::plus_all<Pose2d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
template void detail::plus_all<Rot3d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
template void detail::plus_all<Pose3d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
template void detail::plus_all<Point2d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
template void detail::plus_all<Point3d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
template void detail::plus_all<Velocity3d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
template void detail::plus_all<ImuBiasd>(std::size_t, const void*, const double*, const std::int32_t*, void*);
template void detail::plus_all<InverseDepthd>(std::size_t, const void*, const double*, const std::int32_t*, void*);
template void detail::plus_all<BalCamerad>(std::size_t, const void*, const double*, const std::int32_t*, void*);
template void detail::minus_one<Rot2d>(const void*, const void*, double*);
template void detail::minus_one<Pose2d>(const void*, const void*, double*);
template void detail::minus_one<Rot3d>(const void*, const void*, double*);
template void detail::minus_one<Pose3d>(const void*, const void*, double*);
template void detail::minus_one<Point2d>(const void*, const void*, double*);
template void detail::minus_one<Point3d>(const void*, const void*, double*);
template void detail::minus_one<Velocity3d>(const void*, const void*, double*);
template void detail::minus_one<ImuBiasd>(const void*, const void*, double*);
template void detail::minus_one<InverseDepthd>(const void*, const void*, double*);
template void detail::minus_one<BalCamerad>(const void*, const void*, double*);
template void detail::world_axes_of<Pose2d>(const void*, double*);
template void detail::world_axes_of<Rot3d>(const void*, double*);
template void detail::world_axes_of<Pose3d>(const void*, double*);

}  // namespace oriel
