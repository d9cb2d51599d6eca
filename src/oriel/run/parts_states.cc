// The shipped providers of states and builders of factors, by name.
#include "oriel/residual/gnss.h"
#include "oriel/run/inertial_start.h"
#include "oriel/run/window_parts.h"
#include "oriel/run/words.h"
#include "oriel/window/constant_velocity_provider.h"
#include "oriel/window/odometry_provider.h"
#include "oriel/window/sensor_builder.h"
#include "oriel/window/structureless_builder.h"
#include "oriel/window/track_builder.h"

namespace oriel {
namespace {

using namespace setting;

// ---- providers ----

struct ImuPart {
  InertialStartOptions start;
  double noise_factor = InertialOptions{}.noise_factor, walk_factor = InertialOptions{}.walk_factor;
  ImuProviderOptions provider;
};

Result<void> make_imu(const ImuPart& o, WindowAssembly& window) {
  const SensorSuite& sensors = window.sensors();
  if (!sensors.has_imu) return Error{ErrorCode::bad_input, "expected a recording with IMU samples"};
  if (sensors.cameras < 1) return Error{ErrorCode::bad_input, "expected a recording with a camera, for its start"};
  ImuNoise noise = sensors.imu;
  noise.gyro *= o.noise_factor, noise.accel *= o.noise_factor;
  noise.gyro_walk *= o.walk_factor, noise.accel_walk *= o.walk_factor;
  ImuProviderOptions options = o.provider;
  options.gravity = {{0.0, 0.0, -o.start.inertial.gravity}};
  auto provider = std::make_unique<ImuProvider>(noise, options);
  ImuProvider* imu = provider.get();
  window.add(std::move(provider));
  window.on_imu([imu](const ImuSample& s) { return imu->add(s); });
  window.start_by(make_inertial_start(*imu, noise, sensors, window.initialisation(), o.start));
  return {};
}

const std::vector<Setting>& imu_settings() {
  static const std::vector<Setting> settings = {
      {"noise_factor", Real{member<&ImuPart::noise_factor>, kTiny, kHuge}, "-",
       "Multiplies the noise densities of the sensor's data sheet."},
      {"walk_factor", Real{member<&ImuPart::walk_factor>, kTiny, kHuge}, "-", "Multiplies its bias random walks."},
      {"gravity",
       Real{member<&ImuPart::start, &InertialStartOptions::inertial, &InertialOptions::gravity>, kTiny, 100.0}, "m/s2",
       "Length of the gravity vector."},
      {"gyro_bias_sigma",
       Real{member<&ImuPart::start, &InertialStartOptions::inertial, &InertialOptions::gyro_bias_sigma>, kTiny, kHuge},
       "rad/s", "How far the first gyroscope bias may be off."},
      {"accel_bias_sigma",
       Real{member<&ImuPart::start, &InertialStartOptions::inertial, &InertialOptions::accel_bias_sigma>, kTiny, kHuge},
       "m/s2", "How far the first accelerometer bias may be off."},
      {"moving_velocity_sigma",
       Real{member<&ImuPart::start, &InertialStartOptions::moving_velocity_sigma>, kTiny, kHuge}, "m/s",
       "Of the first velocity, where the start is in motion."},
      {"bridge_gaps", Flag{member<&ImuPart::provider, &ImuProviderOptions::bridge_gaps>}, "-",
       "The motion across gaps in the samples is guessed, with the guess's uncertainty."},
      {"restart_position_sigma",
       Real{member<&ImuPart::provider, &ImuProviderOptions::restart, &ImuRestart::position_sigma>, kTiny, kHuge}, "m",
       "Of the position, after the window has begun anew."},
      {"restart_yaw_sigma",
       Real{member<&ImuPart::provider, &ImuProviderOptions::restart, &ImuRestart::yaw_sigma>, kTiny, kHuge}, "rad",
       "Of the heading, after the window has begun anew."},
      {"restart_tilt_sigma",
       Real{member<&ImuPart::provider, &ImuProviderOptions::restart, &ImuRestart::tilt_sigma>, kTiny, kHuge}, "rad",
       "Of roll and pitch, after the window has begun anew."},
      {"restart_velocity_sigma",
       Real{member<&ImuPart::provider, &ImuProviderOptions::restart, &ImuRestart::velocity_sigma>, kTiny, kHuge}, "m/s",
       "Of the velocity, after the window has begun anew."}};
  return settings;
}

Result<void> make_constant_velocity(const ConstantVelocityOptions& o, WindowAssembly& window) {
  window.add(std::make_unique<ConstantVelocityProvider>(o));
  return {};
}

struct OdometryPart {
  double first_sigma = 1e-3;
};

Result<void> make_odometry(const OdometryPart& o, WindowAssembly& window) {
  if (!window.sensors().has_odometry) return Error{ErrorCode::bad_input, "expected a recording with odometry"};
  auto provider =
      std::make_unique<OdometryProvider<Pose3d>>(Pose3d{}, Mat6d::identity() * (o.first_sigma * o.first_sigma));
  window.on_motion([p = provider.get(), begun = false](const MeasuredMotion& m) mutable -> Result<void> {
    if (std::exchange(begun, true)) return p->add(m.time, m.motion, m.covariance);
    p->start_measuring(m.time);
    return {};
  });
  window.add(std::move(provider));
  return {};
}

// ---- builders ----

struct TrackPart {
  std::string states;
  LandmarkModel landmarks = LandmarkModel::by_cameras;
  TrackBuilderOptions builder;
};

// Who sees tracks: by TrackBuilder or StructurelessBuilder.
template <class B>
void see(WindowAssembly& window, B* builder) {
  window.on_frame([builder](const StereoFrame& f) { builder->add(f); });
  TrackWatch watch;
  watch.overlap = [builder](const Graph& g, const States& s, Time a, Time b) { return builder->overlap(g, s, a, b); };
  if constexpr (requires { builder->motion(Time{}, Time{}); })
    watch.motion = [builder](Time a, Time b) { return builder->motion(a, b); };
  window.see_tracks(std::move(watch));
  window.count("no_ray", [builder] { return builder->counts().no_ray; });
}

Result<void> make_tracks(const TrackPart& o, WindowAssembly& window) {
  const auto poses = window.provider_of(o.states, kVariableOps<Pose3d>.key, "a pose");
  if (!poses) return poses.error();
  const auto rig = window.rig();
  if (!rig) return rig.error();
  TrackBuilderOptions options = o.builder;
  options.stereo = options.stereo && window.sensors().cameras > 1;
  const bool points =
      o.landmarks == LandmarkModel::point || (o.landmarks == LandmarkModel::by_cameras && options.stereo);
  options.landmarks = points ? LandmarkKind::point : LandmarkKind::inverse_depth;
  auto builder = std::make_unique<TrackBuilder>(*poses, window.sensors().rig, *rig, options);
  TrackBuilder* tracks = builder.get();
  window.add(std::move(builder));
  see(window, tracks);
  window.count("outlier", [tracks] { return tracks->counts().gated; });
  window.count("refused", [tracks] { return tracks->counts().refused; });
  window.count("repeated_frame", [tracks] { return tracks->counts().repeated; });
  return {};
}

const std::vector<Setting>& track_settings() {
  using B = TrackBuilderOptions;
  static const std::vector<Setting> settings = {
      {"states", Reference{Reference::To::provider, member<&TrackPart::states>}, "-",
       "The provider of the poses that see; empty: the first."},
      {"landmarks", Word{landmark_models(), member<&TrackPart::landmarks>}, "-",
       "What a landmark is: points where two cameras see it and inverse depths where one does, or the same for all."},
      {"stereo", Flag{member<&TrackPart::builder, &B::stereo>}, "-",
       "The second camera is looked at, if there is one."},
      {"pixel_sigma", Real{member<&TrackPart::builder, &B::pixel_sigma>, kTiny, kHuge}, "px",
       "Noise of a coordinate of a sighting."},
      {"loss", Robust{member<&TrackPart::builder, &B::loss>}, "sigma", "Robust loss of sightings, NAME:SCALE."},
      {"gate", Real{member<&TrackPart::builder, &B::gate>, 0.0, kHuge}, "px",
       "A sighting that is further off is taken out before a state leaves; 0: none."},
      {"start_gate", Real{member<&TrackPart::builder, &B::limits, &TrackLimits::start_gate>, kTiny, kHuge}, "px",
       "A landmark does not start while a sighting is further off."},
      {"least_depth", Real{member<&TrackPart::builder, &B::limits, &TrackLimits::least_depth>, kTiny, kHuge}, "m",
       "Nearest landmark."},
      {"greatest_depth", Real{member<&TrackPart::builder, &B::limits, &TrackLimits::greatest_depth>, kTiny, kHuge}, "m",
       "Farthest landmark."},
      {"least_parallax", Real{member<&TrackPart::builder, &B::limits, &TrackLimits::least_parallax>, kTiny, 3.2}, "rad",
       "Of a landmark's rays."},
      {"expected_tracks", Count{member<&TrackPart::builder, &B::expected_tracks>, 20000}, "-",
       "That memory is kept for."},
      {"expected_states", Count{member<&TrackPart::builder, &B::expected_states>, 500}, "-",
       "That memory is kept for."}};
  return settings;
}

struct StructurelessPart {
  std::string states;
  StructurelessOptions builder;
};

Result<void> make_structureless(const StructurelessPart& o, WindowAssembly& window) {
  const auto poses = window.provider_of(o.states, kVariableOps<Pose3d>.key, "a pose");
  if (!poses) return poses.error();
  const auto rig = window.rig();
  if (!rig) return rig.error();
  StructurelessOptions options = o.builder;
  options.stereo = options.stereo && window.sensors().cameras > 1;
  auto builder = std::make_unique<StructurelessBuilder>(*poses, window.sensors().rig, *rig, options);
  StructurelessBuilder* tracks = builder.get();
  window.add(std::move(builder));
  see(window, tracks);
  window.count("late_frame", [tracks] { return tracks->counts().late; });
  window.count("repeated_frame", [tracks] { return tracks->counts().repeated; });
  window.count("lost_correlation", [tracks] { return tracks->counts().lost_correlations; });
  return {};
}

const std::vector<Setting>& structureless_settings() {
  using P = StructurelessPart;
  using B = StructurelessOptions;
  static const std::vector<Setting> settings = {
      {"states", Reference{Reference::To::provider, member<&P::states>}, "-",
       "The provider of the poses that see; empty: the first."},
      {"leaving", Word{"landmark absorb", member<&P::builder, &B::leaving>}, "-",
       "Tracks of a state that leaves: their point becomes a variable, or the whole track goes into the prior."},
      {"stereo", Flag{member<&P::builder, &B::stereo>}, "-", "The second camera is looked at, if there is one."},
      {"pixel_sigma", Real{member<&P::builder, &B::pixel_sigma>, kTiny, kHuge}, "px",
       "Noise of a coordinate of a sighting."},
      {"loss", Robust{member<&P::builder, &B::loss>}, "sigma", "Robust loss of a track as a whole, NAME:SCALE."},
      {"start_gate", Real{member<&P::builder, &B::limits, &TrackLimits::start_gate>, kTiny, kHuge}, "px",
       "A track is not used while a sighting is further off."},
      {"least_depth", Real{member<&P::builder, &B::limits, &TrackLimits::least_depth>, kTiny, kHuge}, "m",
       "Nearest point."},
      {"greatest_depth", Real{member<&P::builder, &B::limits, &TrackLimits::greatest_depth>, kTiny, kHuge}, "m",
       "Farthest point."},
      {"least_parallax", Real{member<&P::builder, &B::limits, &TrackLimits::least_parallax>, kTiny, 3.2}, "rad",
       "Of a track's rays."},
      {"expected_tracks", Count{member<&P::builder, &B::expected_tracks>, 20000}, "-", "That memory is kept for."},
      {"expected_states", Count{member<&P::builder, &B::expected_states>, 500}, "-", "That memory is kept for."}};
  return settings;
}

struct GnssPart {
  std::string states;
  Loss loss = Huber(2.0);
  double x = 0.0, y = 0.0, z = 0.0;
};

Result<void> make_gnss(const GnssPart& o, WindowAssembly& window) {
  if (!window.sensors().has_positions) return Error{ErrorCode::bad_input, "expected a recording with positions"};
  const auto poses = window.provider_of(o.states, kVariableOps<Pose3d>.key, "a pose");
  if (!poses) return poses.error();
  const auto antenna = window.window().core().edit().add(LeverArmd{{{o.x, o.y, o.z}}});
  if (auto ok = window.window().core().commit(); !ok) return ok;
  using Builder = SensorBuilder<GnssPositiond, IsotropicNoise, 1>;
  auto builder = std::make_unique<Builder>("gnss", *poses, o.loss);
  window.on_position([b = builder.get(), antenna](const MeasuredPosition& p) {
    b->add(p.time, GnssPositiond{p.p_world}, Sigma(p.sigma), antenna);
  });
  window.add(std::move(builder));
  return {};
}

}  // namespace

NameTable<WindowPart> shipped_providers() {
  NameTable<WindowPart> table("provider");
  add_shipped(table, "imu",
              window_part<ImuPart>("Poses, velocities and biases, linked by preintegrated IMU samples.", imu_settings(),
                                   make_imu));
  using V = ConstantVelocityOptions;
  add_shipped(table, "constant_velocity",
              window_part<V>("Poses and velocities, linked by motion that is nearly even.",
                             {{"acceleration", Real{member<&V::acceleration>, kTiny, kHuge}, "m/s2/sqrt(Hz)",
                               "Density of the white noise on the acceleration."},
                              {"rotation", Real{member<&V::rotation>, kTiny, kHuge}, "rad/s/sqrt(Hz)",
                               "Density of the white noise on the angular velocity."},
                              {"longest", Seconds{member<&V::longest>}, "s",
                               "Between two states; what is further off cannot be had."}},
                             make_constant_velocity));
  add_shipped(table, "odometry",
              window_part<OdometryPart>("Poses, linked by measured motions.",
                                        {{"first_sigma", Real{member<&OdometryPart::first_sigma>, kTiny, kHuge},
                                          "rad, m", "Of the first pose, which is the origin."}},
                                        make_odometry));
  return table;
}

NameTable<WindowPart> shipped_builders() {
  NameTable<WindowPart> table("builder");
  add_shipped(table, "tracks",
              window_part<TrackPart>("Landmarks and a reprojection for each sighting.", track_settings(), make_tracks));
  add_shipped(table, "structureless",
              window_part<StructurelessPart>("A factor for each track, its point projected out.",
                                             structureless_settings(), make_structureless));
  add_shipped(
      table, "gnss",
      window_part<GnssPart>("Positions of an antenna in the world.",
                            {{"states", Reference{Reference::To::provider, member<&GnssPart::states>}, "-",
                              "The provider of the body's poses; empty: the first."},
                             {"loss", Robust{member<&GnssPart::loss>}, "sigma", "Robust loss, NAME:SCALE."},
                             {"antenna_x", Real{member<&GnssPart::x>, -1e6, 1e6}, "m", "Of the antenna in the body."},
                             {"antenna_y", Real{member<&GnssPart::y>, -1e6, 1e6}, "m", "Of the antenna in the body."},
                             {"antenna_z", Real{member<&GnssPart::z>, -1e6, 1e6}, "m", "Of the antenna in the body."}},
                            make_gnss));
  return table;
}

}  // namespace oriel
