#include "oriel/testing/consistency.h"

#include <numeric>

#include "oriel/testing/random.h"

namespace oriel {
namespace {

constexpr std::uint64_t kStartStream = 50;

// The truth less a draw from the prior: r = x ⊟ value is then the draw.
InertialValues guess_of(const SimulatedTruth& truth, const StartSigmas& sigmas, std::uint64_t seed) {
  SeededRandom random(seed, kStartStream);
  Vec6d off;
  for (int i = 0; i < 6; ++i) off[i] = -sigmas.pose[i] * random.normal();
  InertialValues v{truth.T_world_body.plus(off), truth.velocity, truth.bias};
  v.velocity.v -= random.normals<3>(sigmas.velocity);
  v.bias.gyro -= random.normals<3>(sigmas.gyro_bias);
  v.bias.accel -= random.normals<3>(sigmas.accel_bias);
  return v;
}

Result<ConsistencySample> sample_of(InertialOdometry& odometry, const SimulatedWorld& world) {
  const InertialState& state = *odometry.timeline().latest();
  const SimulatedTruth truth = world.truth(state.time);
  const InertialValues estimate = odometry.values(state);
  ConsistencySample s;
  s.t = (state.time - world.options().start).seconds();
  s.error.set_segment(0, truth.T_world_body.minus(estimate.T_world_body));
  s.error.set_segment(6, truth.velocity.v - estimate.velocity.v);
  const VariableKey ids[] = {state.pose, state.velocity};
  const auto covariance = odometry.window().joint_covariance(ids);
  if (!covariance) return covariance.error();
  for (int i = 0; i < 81; ++i) s.covariance.m[i] = (*covariance)[static_cast<std::size_t>(i)];
  return s;
}

}  // namespace

ConsistencyOptions consistency_options(double seconds) {
  ConsistencyOptions o;
  o.world.seconds = seconds;
  o.world.cameras.timing.rate_hz = 10.0;
  o.world.cameras.tracks = 40;
  // Near enough for stereo: the depth of what is far is no normal variable, and no Gaussian window can be honest about
  // it.
  o.world.cameras.farthest_birth = 5.0;
  o.world.cameras.greatest_depth = 10.0;
  constexpr double kNever = 1e9;
  o.odometry.keyframes.max_keyframes = 8;
  o.odometry.keyframes.expected_tracks = o.world.cameras.tracks;
  VisualOptions& v = o.odometry.visual;
  v.pixel_sigma = o.world.cameras.pixel_sigma;
  v.landmarks = LandmarkModel::point;
  v.loss = Loss{};
  v.gate = v.match_gate = v.start_gate = v.refine_above = kNever;
  v.least_depth = 0.05;
  v.greatest_depth = kNever;
  o.odometry.inertial.noise_factor = o.odometry.inertial.walk_factor = 1.0;
  o.odometry.max_iterations = 20;
  o.odometry.function_tolerance = 1e-9;
  return o;
}

Result<ConsistencyRun> consistency_run(const ConsistencyOptions& options, std::uint64_t seed) {
  SimulatedWorldOptions world_options = options.world;
  world_options.seed = seed;
  auto world = SimulatedWorld::make(world_options);
  if (!world) return world.error();
  InertialOdometry odometry(world->rig(), world_options.cameras.stereo, world_options.imu.noise, options.odometry);
  ConsistencyRun run;
  int frames = 0;
  for (SimulatedMeasurement m; world->next(m);) {
    if (m.sensor == SimulatedSensor::imu)
      if (auto ok = odometry.add_imu(m.imu); !ok) return ok.error();
    if (m.sensor != SimulatedSensor::camera) continue;
    const StereoFrame frame{m.stamp, m.features};
    const UpdateReport report =
        frames == 0 ? odometry.start_at(frame, guess_of(world->truth(m.time), options.start, seed), options.start)
                    : odometry.update(frame);
    if (report.status != UpdateReport::Status::tracking && report.status != UpdateReport::Status::initialised)
      return Error{ErrorCode::bad_input,
                   "frame " + std::to_string(frames) + " of seed " + std::to_string(seed) + ": " + report.reason};
    if (++frames % options.frames_per_epoch != 0) continue;
    auto sample = sample_of(odometry, *world);
    if (!sample) return sample.error();
    run.samples.push_back(*sample);
  }
  const auto& dropped = odometry.dropped();
  run.dropped = std::accumulate(dropped.begin(), dropped.end(), std::int64_t{0});
  return run;
}

}  // namespace oriel
