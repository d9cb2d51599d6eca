#include "oriel/run/registry.h"

#include <utility>

#include "oriel/manifold/bal_camera.h"
#include "oriel/manifold/inverse_depth.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/so3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/bal.h"
#include "oriel/residual/between.h"
#include "oriel/residual/body_velocity.h"
#include "oriel/residual/gnss.h"
#include "oriel/residual/imu_residual.h"
#include "oriel/residual/matched_point.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/pose_graph.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/range.h"
#include "oriel/residual/registration.h"
#include "oriel/residual/reprojection.h"
#include "oriel/residual/structureless_track.h"
#include "oriel/sensor/stereo_rig.h"

namespace oriel {
namespace {

// A residual with every noise shape.
template <class R>
void add(TypeList& types) {
  types.factor<R, IsotropicNoise>();
  types.factor<R, DiagonalNoise<ResidualTraits<R>::kDim>>();
  types.factor<R, FullNoise<ResidualTraits<R>::kDim>>();
}
template <class... R>
void add_each(TypeList& types) {
  (add<R>(types), ...);
}

template <int... N>
void add_tracks(TypeList& types, std::integer_sequence<int, N...>) {
  (types.factor<StructurelessTrack<N + 2>, IsotropicNoise>(), ...);
}

}  // namespace

TypeList shipped_types() {
  TypeList types;
  types.variable<Point2d>().variable<Point3d>().variable<Rot2d>().variable<Rot3d>();
  add_each<Prior<Point2d>, Prior<Point3d>, Prior<Velocity3d>, Prior<ImuBiasd>, Prior<Rot3d>, Prior<Pose2d>,
           Prior<Pose3d>, Prior<InverseDepthd>>(types);
  add_each<Between<Point3d>, Between<Rot3d>, Between<Pose2d>, Between<Pose3d>>(types);
  add_each<PoseGraphEdge2d, PoseGraphEdge3d, PoseGraphEdgeLog3d>(types);
  add_each<GnssPositiond, BodyVelocityd>(types);
  types.factor<RangeToPointd, IsotropicNoise>().factor<RangeToBeacond, IsotropicNoise>();
  types.factor<ImuResiduald, FullNoise<ResidualTraits<ImuResiduald>::kDim>>();
  types.factor<BalReprojectiond, IsotropicNoise>();
  types.factor<StereoReprojection<double>, IsotropicNoise>();
  types.factor<MonoReprojection<double, 0>, IsotropicNoise>().factor<MonoReprojection<double, 1>, IsotropicNoise>();
  types.factor<AnchorReprojection<double>, IsotropicNoise>();
  types.factor<StereoPointReprojection<double>, IsotropicNoise>();
  types.factor<MonoPointReprojection<double, 0>, IsotropicNoise>();
  types.factor<MonoPointReprojection<double, 1>, IsotropicNoise>();
  add_tracks(types, std::make_integer_sequence<int, detail::kMostTrackViews - 1>{});
  types.factor<PointToPointd, IsotropicNoise>().factor<PointToPointd, FullNoise<3>>();
  types.factor<MatchedPixeld, FullNoise<2>>().factor<MatchedDisparityd, FullNoise<3>>();
  types.factor<MatchedStereod, FullNoise<4>>();
  return types;
}

}  // namespace oriel
