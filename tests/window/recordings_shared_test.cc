// Real recordings through the window, with the default options alone.
#include <gtest/gtest.h>

#include "oriel/evaluate/ate.h"
#include "oriel/io/euroc_import.h"
#include "oriel/window/inertial_odometry.h"

namespace oriel {
namespace {

struct Outcome {
  double ate_m = 0.0;
  std::size_t estimated = 0;
};

StereoRigd rig_of(const Recording& r) {
  StereoRigd rig;
  for (std::size_t c = 0; c < 2; ++c) {
    const RecordedCamera& k = r.cameras[c];
    rig.cameras[c] = {RadTanCamerad{k.fx, k.fy, k.cx, k.cy, k.k1, k.k2, k.p1, k.p2},
                      {Rot3d::from_matrix(k.R_body_camera), k.p_body_camera}};
  }
  return rig;
}

Outcome run(const char* folder) {
  const Result<Recording> r = read_euroc(std::string(ORIEL_SHARED_DIR) + "/vio/" + folder);
  if (!r) return {1e9, 0};
  const RecordedImuNoise& n = r->imu_noise;
  InertialOdometry odometry(
      rig_of(*r), true,
      {n.gyroscope_noise_density, n.accelerometer_noise_density, n.gyroscope_random_walk, n.accelerometer_random_walk},
      {});
  std::size_t next = 0;
  for (const RecordedFrame& f : r->frames) {
    for (bool more = true; more && next < r->imu.size(); ++next) {
      more = r->imu[next].time < f.time;
      EXPECT_TRUE(odometry.add_imu({r->imu[next].time, r->imu[next].gyro, r->imu[next].accel}).ok());
    }
    std::vector<FeatureObservation> features;
    for (const RecordedObservation& o : r->observations_of(f))
      features.push_back({o.track_id, {{o.u0, o.v0}}, {{o.u1, o.v1}}, o.has_right});
    (void)odometry.update({f.time, features});
  }
  std::vector<TumPose> estimate;
  for (const auto& [time, T] : odometry.causal().poses())
    estimate.push_back({time, T.t, T.R.qx, T.R.qy, T.R.qz, T.R.qw});
  const auto pairs = nearest_stamps(estimate, r->groundtruth, Duration{10'000'000});
  const auto error = absolute_error(estimate, r->groundtruth, pairs, Alignment::se3);
  return {error ? error->position.rmse : 1e9, estimate.size()};
}

TEST(Recordings, FollowTheWholeFlightV101FromItsKeyframesWithinTenCentimetres) {
  const Outcome o = run("euroc_v101_keyframes");
  EXPECT_LE(o.ate_m, 0.10);
  EXPECT_GE(o.estimated, 98u);
}

TEST(Recordings, FollowTheStartOfMh01InMotionWithinFifteenMillimetres) {
  const Outcome o = run("euroc_mh01_first10s");
  EXPECT_LE(o.ate_m, 0.015);
  EXPECT_GE(o.estimated, 160u);
}

}  // namespace
}  // namespace oriel
