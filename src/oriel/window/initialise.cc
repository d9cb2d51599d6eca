#include "oriel/window/initialise.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace oriel {
namespace {

struct Means {
  int count = 0;
  Vec3d gyro = Vec3d::zero(), accel = Vec3d::zero();
  void add(const ImuSample& s) {
    ++count;
    gyro += s.gyro;
    accel += s.accel;
  }
  Means mean() const { return {count, gyro / count, accel / count}; }
};

Eigen::Vector3d eigen(const Vec3d& v) { return {v[0], v[1], v[2]}; }
Vec3d oriel_vector(const Eigen::Vector3d& v) { return {{v[0], v[1], v[2]}}; }
Eigen::Matrix3d eigen(const Mat3d& m) { return Eigen::Map<const Eigen::Matrix3d>(m.data()); }

constexpr double kPoseNoise = 0.005;  // of a stereo pose, for the weights of the alignment [m]

Result<std::vector<Preintegration>> preintegrate_pairs(std::span<const TimedPose> poses, const ImuBuffer& imu,
                                                       const ImuNoise& noise, const ImuBiasd& bias) {
  std::vector<Preintegration> pairs;
  for (std::size_t k = 1; k < poses.size(); ++k) {
    Result<Preintegration> p = preintegrate(imu.samples(), poses[k - 1].time, poses[k].time, bias, noise);
    if (!p) return p.error();
    pairs.push_back(*p);
  }
  return pairs;
}

// The bias that brings the gyroscope's rotations nearest to those of the poses: dR_dg δ = Log(ΔRᵀ R_iᵀ R_j), weighted
// alike.
void improve_gyro_bias(std::span<const TimedPose> poses, const std::vector<Preintegration>& pairs, ImuBiasd& bias) {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const Rot3d R_ij = poses[k].T_world_body.R.inverse() * poses[k + 1].T_world_body.R;
    const Eigen::Matrix3d J = eigen(pairs[k].motion.dR_dg);
    H += J.transpose() * J;
    g += J.transpose() * eigen((pairs[k].motion.dR.inverse() * R_ij).log());
  }
  bias.gyro += oriel_vector(H.ldlt().solve(g));
}

// Normal equations over [v_0, ..., v_n, g, a].
class AlignmentSystem {
 public:
  explicit AlignmentSystem(std::size_t poses)
      : n_(static_cast<Eigen::Index>(poses)),
        H_(Eigen::MatrixXd::Zero(3 * n_ + 6, 3 * n_ + 6)),
        b_(Eigen::VectorXd::Zero(3 * n_ + 6)) {}

  void add_pair(Eigen::Index i, const TimedPose& from, const TimedPose& to, const Preintegration& p) {
    const double dt = p.motion.dt;
    const Eigen::Matrix3d R = eigen(from.T_world_body.R.matrix());
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(6, 3 * n_ + 6);
    Eigen::VectorXd y(6);
    A.block<3, 3>(0, 3 * i).diagonal().setConstant(dt);
    A.block<3, 3>(0, 3 * n_).diagonal().setConstant(0.5 * dt * dt);
    A.block<3, 3>(0, 3 * n_ + 3) = R * eigen(p.motion.dp_da);
    y.head<3>() = eigen(to.T_world_body.t - from.T_world_body.t) - R * eigen(p.motion.dp);
    A.block<3, 3>(3, 3 * i).diagonal().setConstant(-1.0);
    A.block<3, 3>(3, 3 * (i + 1)).diagonal().setConstant(1.0);
    A.block<3, 3>(3, 3 * n_).diagonal().setConstant(-dt);
    A.block<3, 3>(3, 3 * n_ + 3) = -R * eigen(p.motion.dv_da);
    y.tail<3>() = R * eigen(p.motion.dv);
    const double position = 1.0 / (p.covariance(6, 6) + 2.0 * kPoseNoise * kPoseNoise),
                 velocity = 1.0 / p.covariance(3, 3);
    Eigen::VectorXd w(6);
    w << position, position, position, velocity, velocity, velocity;
    H_ += A.transpose() * w.asDiagonal() * A;
    b_ += A.transpose() * w.asDiagonal() * y;
  }
  Eigen::VectorXd solve(double accel_bias_sigma) {
    H_.bottomRightCorner<3, 3>().diagonal().array() += 1.0 / (accel_bias_sigma * accel_bias_sigma);
    return H_.ldlt().solve(b_);
  }

 private:
  Eigen::Index n_;
  Eigen::MatrixXd H_;
  Eigen::VectorXd b_;
};

}  // namespace

Rot3d level(const Vec3d& up) {
  const Vec3d u = up / up.norm(), z = {{0.0, 0.0, 1.0}};
  const double c = u[2];
  if (c < -0.999999) return Rot3d{1.0, 0.0, 0.0, 0.0};  // upside down: half a turn about x
  const Vec3d axis = cross(u, z);
  return Rot3d::from_quaternion(1.0 + c, axis[0], axis[1], axis[2]);
}

std::optional<Standstill> find_standstill(std::span<const ImuSample> samples, Time t0, Time until,
                                          const InitialisationOptions& options) {
  Means first, all, block;
  Time end = t0 + options.block;
  Duration length{0};
  for (const ImuSample& s : samples) {
    if (s.time < t0) continue;
    if (s.time >= end) {  // a block is full
      if (block.count == 0) break;
      const Means mean = block.mean();
      if (first.count == 0) first = mean;
      if ((mean.gyro - first.gyro).norm() > options.still_gyro ||
          (mean.accel - first.accel).norm() > options.still_accel)
        break;
      length = end - t0;
      all.count += block.count;
      all.gyro += block.gyro;
      all.accel += block.accel;
      block = {};
      end = end + options.block;
    }
    if (s.time > until) break;
    block.add(s);
  }
  if (length < options.still || length.ns == 0) return std::nullopt;
  const Means mean = all.mean();
  return Standstill{length, mean.gyro, mean.accel};
}

Result<InertialAlignment> align_inertial(std::span<const TimedPose> poses, const ImuBuffer& imu, const ImuNoise& noise,
                                         const InertialOptions& options) {
  InertialAlignment out;
  std::vector<Preintegration> pairs;
  for (int pass = 0; pass < 3; ++pass) {  // the last leaves the pairs integrated with the bias that was found
    Result<std::vector<Preintegration>> p = preintegrate_pairs(poses, imu, noise, out.bias);
    if (!p) return p.error();
    pairs = std::move(*p);
    if (pass < 2) improve_gyro_bias(poses, pairs, out.bias);
  }
  AlignmentSystem system(poses.size());
  for (std::size_t k = 0; k < pairs.size(); ++k)
    system.add_pair(static_cast<Eigen::Index>(k), poses[k], poses[k + 1], pairs[k]);
  const Eigen::VectorXd x = system.solve(options.accel_bias_sigma);
  if (!x.allFinite())
    return Error{ErrorCode::singular, "inertial alignment: the poses do not determine velocity and gravity", {}, 0};
  const Eigen::Index n = static_cast<Eigen::Index>(poses.size());
  for (Eigen::Index k = 0; k < n; ++k) out.velocities.push_back(oriel_vector(x.segment<3>(3 * k)));
  out.gravity = oriel_vector(x.segment<3>(3 * n));
  out.bias.accel = oriel_vector(x.segment<3>(3 * n + 3));
  return out;
}

void Initialiser::add(const StereoFrame& frame) {
  std::erase_if(frames_, [&](const Kept& k) {
    return frame.time - k.time > options_.initialisation.longest && frames_.size() > 12;
  });
  frames_.push_back({frame.time, {frame.features.begin(), frame.features.end()}});
}

Initialisation Initialiser::attempt(const ImuBuffer& imu) {
  Initialisation none;
  const Time t0 = frames_.front().time, now = frames_.back().time;
  if (frames_.size() < 2) {
    none.reason = "one frame";
    return none;
  }
  const auto still = find_standstill(imu.samples(), t0, now, options_.initialisation);
  if (still && tracks_are_still(t0 + still->length)) return start_still(*still);
  if (!stereo_) {
    none.reason = "one camera: a start in motion needs two";
    return none;
  }
  if (now - t0 < options_.initialisation.moving ||
      frames_.size() < static_cast<std::size_t>(options_.initialisation.least_frames)) {
    none.reason = "moving, and too few frames";
    return none;
  }
  return start_moving(imu);
}

// An even glide is rest to an IMU; the cameras see the difference, if there is a frame in that time.
bool Initialiser::tracks_are_still(Time until) const {
  std::size_t last = 0;
  while (last + 1 < frames_.size() && frames_[last + 1].time <= until) ++last;
  std::vector<double> moved;
  for (const FeatureObservation& f : frames_[last].features)
    for (const FeatureObservation& g : frames_.front().features)
      if (g.track == f.track) moved.push_back((f.pixel0 - g.pixel0).norm());
  if (moved.size() < static_cast<std::size_t>(options_.initialisation.least_inliers)) return true;
  const auto middle = moved.begin() + static_cast<std::ptrdiff_t>(moved.size() / 2);
  std::nth_element(moved.begin(), middle, moved.end());
  return *middle <= options_.initialisation.still_pixels;
}

Initialisation Initialiser::start_still(const Standstill& still) const {
  Initialisation out;
  out.kind = Initialisation::Kind::standstill;
  out.bias.gyro = still.gyro;
  out.states.push_back({0, frames_.front().time, {level(still.accel), Vec3d::zero()}, Vec3d::zero()});
  return out;
}

// Stereo poses of the frames since the last gap in the IMU's samples; one that finds too few points is passed over, and
// the gyroscope turns across it.
std::vector<Initialiser::Placed> Initialiser::place_frames(const ImuBuffer& imu) const {
  std::vector<Placed> placed;
  StereoOdometry odometry(rig_, options_.initialisation.least_inliers);
  for (std::size_t k = 0; k < frames_.size(); ++k) {
    Rot3d turn;
    if (!placed.empty()) {
      const auto p = preintegrate(imu.samples(), placed.back().pose.time, frames_[k].time, ImuBiasd{}, noise_);
      if (p) {
        turn = p->motion.dR;
      } else {  // a gap: what comes after it begins anew
        placed.clear();
        odometry = StereoOdometry(rig_, options_.initialisation.least_inliers);
      }
    }
    if (odometry.add(frame(k), turn) >= options_.initialisation.least_inliers)
      placed.push_back({k, odometry.poses().back()});
  }
  return placed;
}

Initialisation Initialiser::start_moving(const ImuBuffer& imu) {
  Initialisation out;
  const std::vector<Placed> placed = place_frames(imu);
  out.reason = "too few frames with stereo poses and IMU samples";
  if (placed.size() < static_cast<std::size_t>(options_.initialisation.least_frames)) return out;
  const Duration span = placed.back().pose.time - placed.front().pose.time;
  if (span.ns < options_.initialisation.moving.ns / 2) return out;
  const Duration spacing{span.ns / std::max(1, options_.keyframes.max_keyframes - 1) * 19 / 20};
  std::vector<std::size_t> chosen;
  std::vector<TimedPose> poses;
  for (const Placed& p : placed) {
    if (&p != &placed.back() && !poses.empty() && p.pose.time - poses.back().time < spacing) continue;
    poses.push_back(p.pose);
    chosen.push_back(p.frame);
  }
  const Result<InertialAlignment> aligned = align_inertial(poses, imu, noise_, options_.inertial);
  out.reason = "poses and IMU do not determine gravity";
  if (!aligned) return out;
  out.reason = "gravity has the wrong length: poses and IMU disagree";
  if (!(std::fabs(aligned->gravity.norm() - options_.inertial.gravity) < options_.initialisation.gravity_tolerance))
    return out;
  const Rot3d R_world_first = level(-aligned->gravity);
  for (std::size_t k = 0; k < poses.size(); ++k)
    out.states.push_back({chosen[k], poses[k].time, Pose3d{R_world_first, Vec3d::zero()} * poses[k].T_world_body,
                          R_world_first * aligned->velocities[k]});
  out.bias = aligned->bias;
  out.kind = Initialisation::Kind::moving;
  out.reason = "";
  return out;
}

}  // namespace oriel
