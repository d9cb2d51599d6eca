// A replica follows a whole visual-inertial run, marginalization and first estimates included.
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "oriel/graph/fingerprint.h"
#include "oriel/io/euroc_import.h"
#include "oriel/run/registry.h"
#include "oriel/run/replica.h"
#include "oriel/window/inertial_odometry.h"

namespace oriel {
namespace {

const std::string kData = ORIEL_SHARED_DIR;

// Tells a replica of every edit and every solve, and compares after each.
class Comparison final : public WindowObserver {
 public:
  Comparison(WindowCore& window, Replica& replica)
      : window_(window), replica_(replica), subscription_(window.followed().subscribe()) {}

  void edited() override { EXPECT_TRUE(replica_.follow(window_.followed(), subscription_)); }
  void solved(const SolveOptions& options, const SolverState& before, const Summary& summary,
              const NativeEngine&) override {
    EXPECT_TRUE(random_() % 3 > 0 || replica_.drop_caches());
    SolveRequest request = request_of(options, before, summary);
    request.options.threads = 1 + static_cast<int>(random_() % 2);
    EXPECT_TRUE(replica_.solve(request));
    const auto got = replica_.outcome();
    ++solves_;
    if (!got) {
      ADD_FAILURE() << got.error();
      return;
    }
    same_ += got->fingerprint == fingerprint(window_.graph());
    first_estimates_ += first_estimate_count() > 0;
  }
  int solves() const { return solves_; }
  int same() const { return same_; }
  int with_first_estimates() const { return first_estimates_; }

 private:
  std::uint32_t first_estimate_count() const {
    std::uint32_t n = 0;
    for (const auto& p : window_.graph().pools()) n += p->first_estimate_count();
    return n;
  }

  WindowCore& window_;
  Replica& replica_;
  Subscription subscription_;
  std::mt19937 random_{11};
  int solves_ = 0, same_ = 0, first_estimates_ = 0;
};

StereoRigd rig_of(const Recording& recording) {
  StereoRigd rig;
  for (std::size_t c = 0; c < 2; ++c) {
    const RecordedCamera& k = recording.cameras[c];
    rig.cameras[c] = {RadTanCamerad{k.fx, k.fy, k.cx, k.cy, k.k1, k.k2, k.p1, k.p2},
                      {Rot3d::from_matrix(k.R_body_camera), k.p_body_camera}};
  }
  return rig;
}

void expect_same_bits(const std::string& folder) {
  auto replica = Replica::start(shipped_types());
  ASSERT_TRUE(replica) << replica.error();
  const auto recording = read_euroc(kData + "/vio/" + folder);
  ASSERT_TRUE(recording) << recording.error();
  const RecordedImuNoise& n = recording->imu_noise;
  InertialOdometry odometry(
      rig_of(*recording), true,
      {n.gyroscope_noise_density, n.accelerometer_noise_density, n.gyroscope_random_walk, n.accelerometer_random_walk},
      {});
  Comparison comparison(odometry.window(), *replica);
  odometry.window().observe(&comparison);
  std::size_t imu = 0;
  std::vector<FeatureObservation> features;
  for (const RecordedFrame& frame : recording->frames) {
    for (bool reached = false; !reached && imu < recording->imu.size(); ++imu) {
      const RecordedImu& s = recording->imu[imu];
      ASSERT_TRUE(odometry.add_imu({s.time, s.gyro, s.accel}));
      reached = s.time >= frame.time;
    }
    features.clear();
    for (const RecordedObservation& o : recording->observations_of(frame))
      features.push_back({o.track_id, {{o.u0, o.v0}}, {{o.u1, o.v1}}, o.has_right});
    static_cast<void>(odometry.update({frame.time, features}));
  }
  EXPECT_GT(comparison.solves(), 90);
  EXPECT_GT(comparison.with_first_estimates(), 50);
  EXPECT_EQ(comparison.same(), comparison.solves());
}

// R1
TEST(ReplicaOfARecording, HasTheSameBitsOverAllOfV101) { expect_same_bits("euroc_v101_keyframes"); }
// R1
TEST(ReplicaOfARecording, HasTheSameBitsOverAllOfMh01) { expect_same_bits("euroc_mh01_first10s"); }

}  // namespace
}  // namespace oriel
