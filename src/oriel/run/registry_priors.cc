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
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/run/registry_add.h"
#include "oriel/sensor/imu.h"

namespace oriel::run_detail {
namespace {

template <int... N>
void add_vectors(TypeList& types, std::integer_sequence<int, N...>) {
  add_each<Prior<VectorNd<N + 1>>...>(types);
}
}  // namespace

void add_priors(TypeList& types) {
  add_each<Prior<Point2d>, Prior<Point3d>, Prior<Velocity3d>, Prior<ImuBiasd>, Prior<Rot2d>, Prior<Rot3d>,
           Prior<Pose2d>, Prior<Pose3d>, Prior<Sim3d>, Prior<UnitVector3d>, Prior<Positived>, Prior<InverseDepthd>,
           Prior<BalCamerad>, Prior<PinholeIntrinsicsd>>(types);
  add_each<Between<Point2d>, Between<Point3d>, Between<Velocity3d>, Between<ImuBiasd>, Between<Rot2d>, Between<Rot3d>,
           Between<Pose2d>, Between<Pose3d>, Between<Sim3d>>(types);
  add_vectors(types, std::make_integer_sequence<int, 9>{});
}

}  // namespace oriel::run_detail
