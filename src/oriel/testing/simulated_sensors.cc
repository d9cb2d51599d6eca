#include "oriel/testing/simulated_sensors.h"

#include <algorithm>
#include <cmath>

namespace oriel::simulated {

BiasWalk::BiasWalk(const SimulatedImu& imu, std::uint64_t seed)
    : noise_(imu.noise),
      root_dt_(1.0 / std::sqrt(imu.timing.rate_hz > 0.0 ? imu.timing.rate_hz : 1.0)),
      seed_(seed),
      random_(stream(seed, Stream::imu_bias)) {
  ImuBiasd bias;
  bias.gyro = random_.normals<3>(imu.gyro_bias_sigma);
  bias.accel = random_.normals<3>(imu.accel_bias_sigma);
  starts_.push_back(bias);
  begin(0);
}

void BiasWalk::begin(std::int64_t block) {
  tick_ = block * kBlock;
  bias_ = starts_[static_cast<std::size_t>(block - first_block_)];
  random_ = stream(seed_, Stream::imu_bias_blocks, static_cast<std::uint64_t>(block));
}

ImuBiasd BiasWalk::at(std::int64_t tick) {
  tick = std::max(tick, first_block_ * kBlock);
  const std::int64_t newest = first_block_ + static_cast<std::int64_t>(starts_.size()) - 1;
  const std::int64_t nearest = std::min(tick / kBlock, newest);
  if (tick < tick_ || tick_ / kBlock < nearest) begin(nearest);
  while (tick_ < tick) {
    bias_.gyro += random_.normals<3>(noise_.gyro_walk * root_dt_);
    bias_.accel += random_.normals<3>(noise_.accel_walk * root_dt_);
    if (++tick_ % kBlock != 0) continue;
    if (tick_ / kBlock == first_block_ + static_cast<std::int64_t>(starts_.size())) starts_.push_back(bias_);
    begin(tick_ / kBlock);
  }
  return bias_;
}

void BiasWalk::forget_before(std::int64_t tick) {
  const std::int64_t newest = first_block_ + static_cast<std::int64_t>(starts_.size()) - 1;
  const std::int64_t block = std::min(tick / kBlock, newest);
  if (block <= first_block_) return;
  starts_.erase(starts_.begin(), starts_.begin() + (block - first_block_));
  first_block_ = block;
  if (tick_ < block * kBlock) begin(block);
}

bool TrackSource::project(const Pose3d& T_world_body, int camera, const Vec3d& p_world, Vec2d& pixel) const {
  const auto& mount = rig_.cameras[camera];
  const Vec3d h = transposed_times(mount.R_body_camera, T_world_body.inverse() * p_world - mount.t_body_camera);
  return h[2] >= cameras_.least_depth && h[2] <= cameras_.greatest_depth && mount.camera.project(h, pixel, nullptr) &&
         pixel[0] > 0.0 && pixel[0] < cameras_.width && pixel[1] > 0.0 && pixel[1] < cameras_.height;
}

// A landmark somewhere in view of camera 0, all depths of its range being equally likely in their logarithm.
void TrackSource::begin(const Pose3d& T_world_body) {
  const auto& mount = rig_.cameras[0];
  const double ratio = cameras_.farthest_birth / cameras_.nearest_birth;
  for (;;) {
    const Vec2d pixel = {{tracks_.uniform(0.0, cameras_.width), tracks_.uniform(0.0, cameras_.height)}};
    const double depth = cameras_.nearest_birth * std::pow(ratio, tracks_.uniform());
    const Result<Vec2d> ray = mount.camera.unproject(pixel);
    if (!ray) continue;
    const Vec3d p_camera = Vec3d{{(*ray)[0], (*ray)[1], 1.0}} * depth;
    live_.push_back(landmarks());
    landmarks_.push_back(T_world_body * (mount.R_body_camera * p_camera + mount.t_body_camera));
    return;
  }
}

// Whether a landmark is seen depends on where it is and not on the noise: what noise selects would not have mean 0.
void TrackSource::observe(const Pose3d& T_world_body, std::vector<FeatureObservation>& out) {
  out.clear();
  Vec2d unused;
  std::erase_if(live_, [&](std::int64_t k) {
    const bool lost = tracks_.chance(cameras_.loss);
    return lost || !project(T_world_body, 0, *landmark(k), unused);
  });
  while (live_.size() < static_cast<std::size_t>(cameras_.tracks)) begin(T_world_body);
  for (const std::int64_t k : live_) {
    FeatureObservation f;
    f.track = k;
    const Vec3d& p = *landmark(k);
    (void)project(T_world_body, 0, p, f.pixel0);
    f.has_right = cameras_.stereo && project(T_world_body, 1, p, f.pixel1);
    f.pixel0 += pixels_.normals<2>(cameras_.pixel_sigma);
    const Vec2d right = pixels_.normals<2>(cameras_.pixel_sigma);  // drawn in any case: mono is stereo's left half
    if (f.has_right)
      f.pixel1 += right;
    else
      f.pixel1 = Vec2d::zero();
    out.push_back(f);
  }
}

// Not at every call: half of what is kept moves.
void TrackSource::forget_lost() {
  const std::int64_t lost = (live_.empty() ? landmarks() : live_.front()) - first_landmark_;
  if (2 * lost <= static_cast<std::int64_t>(landmarks_.size())) return;
  landmarks_.erase(landmarks_.begin(), landmarks_.begin() + lost);
  first_landmark_ += lost;
}

}  // namespace oriel::simulated
