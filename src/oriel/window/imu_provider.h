// States of pose, velocity and IMU biases, linked by preintegrated IMU samples (residual/imu_residual.h). The body's
// frame is the IMU's.
#pragma once
#include <array>
#include <optional>

#include "oriel/residual/imu_residual.h"
#include "oriel/residual/prior.h"
#include "oriel/window/imu_buffer.h"
#include "oriel/window/state_provider.h"

namespace oriel {

// What is known after the window has begun anew (ended): the body is where it was, but for what happened since.
struct ImuRestart {
  double position_sigma = 1e-3, yaw_sigma = 1e-3;  // where and how the world goes on [m] [rad]
  double tilt_sigma = 0.3;                         // [rad]
  double velocity_sigma = 1.0;                     // [m/s]
};

struct ImuProviderOptions {
  Vec3d gravity = kStandardGravity;  // in world [m/s²]
  PreintegrationOptions samples{};   // what is no gap
  // Across gaps the motion is guessed, with the guess's uncertainty (sensor/preintegration.h); without, the samples
  // cover nothing that has a gap in it.
  bool bridge_gaps = true;
  Duration horizon{};  // samples are kept for so long before the oldest state (late data) [ns]
  ImuRestart restart{};
  std::size_t expected_samples = 8192;  // in that time and the window: more may ask for memory
};

// What the first state is said to be: a prior each.
struct ImuStart {
  Pose3d T_world_body{};
  Velocity3d velocity{};
  ImuBiasd bias{};
  FullNoise<6> pose_noise = Covariance(Mat6d::identity() * 1e-6);
  IsotropicNoise velocity_noise = Sigma(0.1);                                      // [m/s]
  DiagonalNoise<6> bias_noise = Sigmas(Vec6d{{0.01, 0.01, 0.01, 0.1, 0.1, 0.1}});  // [rad/s] [m/s²]
};

// Of a pose whose position and yaw are put there (they say where and how the world is), and whose roll and pitch are
// for gravity to say. Its tangent is in the body; R_world_body δ has the sigmas (tilt, tilt, yaw). [m] [rad]
FullNoise<6> level_pose_noise(const Pose3d& T_world_body, double position_sigma, double yaw_sigma, double tilt_sigma);

class ImuProvider final : public StateProvider {
 public:
  explicit ImuProvider(const ImuNoise& noise, const ImuProviderOptions& options = {});
  // What the first state is; there is none before it is said.
  void start_at(const ImuStart& start) { start_ = start; }

  // A sample that is not finite, or not later than the one before, is refused, and named.
  Result<void> add(const ImuSample& sample) { return samples_.add(sample); }
  const ImuBuffer& samples() const { return samples_; }

  std::string_view name() const override { return "imu"; }
  std::span<const VariableOps* const> variables() const override { return kOps; }
  bool can_begin(Time time) const override { return start_.has_value() && covers(time, time); }
  Result<void> begin(GraphEdit& edit, State& state) override;
  bool covers(Time from, Time to) const override;
  Result<void> predict(GraphEdit& edit, const State& from, State& state) override;
  // At the biases that the older state has now.
  Result<FactorId> link(GraphEdit& edit, const State& from, const State& to) override;
  void ended(const Graph& graph, const State& last) override;
  void forget_before(Time time) override { samples_.forget_before(time - options_.horizon); }

  static VariableId<Pose3d> pose(const State& s) { return {s.variables[0].key}; }
  static VariableId<Velocity3d> velocity(const State& s) { return {s.variables[1].key}; }
  static VariableId<ImuBiasd> bias(const State& s) { return {s.variables[2].key}; }

 private:
  Result<Preintegration> preintegrate_from(const GraphEdit& edit, const State& from, Time to) const;

  static constexpr std::array<const VariableOps*, 3> kOps = {&kVariableOps<Pose3d>, &kVariableOps<Velocity3d>,
                                                             &kVariableOps<ImuBiasd>};
  ImuNoise noise_;
  ImuProviderOptions options_;
  std::optional<ImuStart> start_;
  ImuBuffer samples_;
};

}  // namespace oriel
