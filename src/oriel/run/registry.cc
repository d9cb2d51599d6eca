#include "oriel/run/registry.h"

#include <utility>

#include "oriel/manifold/bal_camera.h"
#include "oriel/manifold/inverse_depth.h"
#include "oriel/manifold/pinhole_intrinsics.h"
#include "oriel/manifold/positive.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/sim3.h"
#include "oriel/manifold/so3.h"
#include "oriel/manifold/unit_vector.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/bal.h"
#include "oriel/residual/body_velocity.h"
#include "oriel/residual/calibrated_reprojection.h"
#include "oriel/residual/constant_velocity.h"
#include "oriel/residual/direction.h"
#include "oriel/residual/gnss.h"
#include "oriel/residual/imu_residual.h"
#include "oriel/residual/landmark2.h"
#include "oriel/residual/landmark3.h"
#include "oriel/residual/matched_point.h"
#include "oriel/residual/pose_graph.h"
#include "oriel/residual/range.h"
#include "oriel/residual/registration.h"
#include "oriel/residual/reprojection.h"
#include "oriel/residual/sim3.h"
#include "oriel/residual/structureless_track.h"
#include "oriel/run/registry_add.h"
#include "oriel/sensor/stereo_rig.h"

namespace oriel {
namespace {

using run_detail::add_each, run_detail::add_isotropic;

template <int... N>
void add_tracks(TypeList& types, std::integer_sequence<int, N...>) {
  add_isotropic<StructurelessTrack<N + 2>...>(types);
}

void add_cameras(TypeList& types) {
  types.variable<RadTanCamerad>().variable<StereoRigd>();
  add_isotropic<BalReprojectiond, CalibratedReprojectiond>(types);
  add_isotropic<StereoReprojection<double>, MonoReprojection<double, 0>, MonoReprojection<double, 1>>(types);
  add_isotropic<AnchorReprojection<double>>(types);
  add_isotropic<StereoPointReprojection<double>, MonoPointReprojection<double, 0>, MonoPointReprojection<double, 1>>(
      types);
  add_tracks(types, std::make_integer_sequence<int, detail::kMostTrackViews - 1>{});
  types.factor<MatchedPixeld, FullNoise<2>>().factor<MatchedDisparityd, FullNoise<3>>();
  types.factor<MatchedStereod, FullNoise<4>>();
}

}  // namespace

TypeList shipped_types() {
  TypeList types;
  run_detail::add_priors(types);
  add_each<PoseGraphEdge2d, PoseGraphEdge3d, PoseGraphEdgeLog3d>(types);
  add_each<Sighting2d, Bearing2d, Range2d, BearingRange2d, Sighting3d>(types);
  add_each<GnssPositiond, BodyVelocityd>(types);
  add_isotropic<RangeToPointd, RangeToBeacond, DirectionToPointd>(types);
  types.factor<ImuResiduald, FullNoise<ResidualTraits<ImuResiduald>::kDim>>();
  types.factor<ConstantVelocityd, FullNoise<9>>();
  add_cameras(types);
  types.factor<PointToPointd, IsotropicNoise>().factor<PointToPointd, FullNoise<3>>();
  add_isotropic<PointToPlaned, PointToLined>(types);
  return types;
}

}  // namespace oriel
