#include "apps/simulated_recording.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "oriel/io/text.h"

namespace oriel::apps {
namespace {

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text)
    if (c == ':')
      parts.emplace_back();
    else
      parts.back() += c;
  return parts;
}

template <class E, std::size_t N>
std::optional<E> named(const std::array<std::pair<const char*, E>, N>& names, const std::string& name) {
  for (const auto& [text, value] : names)
    if (name == text) return value;
  return std::nullopt;
}

constexpr std::array<std::pair<const char*, SimulatedFaultKind>, 4> kKinds = {{
    {"dropout", SimulatedFaultKind::dropout},
    {"outlier", SimulatedFaultKind::outlier},
    {"blind", SimulatedFaultKind::blind},
    {"saturation", SimulatedFaultKind::saturation},
}};
constexpr std::array<std::pair<const char*, SimulatedSensor>, 2> kRecorded = {{
    {"imu", SimulatedSensor::imu},
    {"camera", SimulatedSensor::camera},
}};

bool parse_times(const std::string& from, const std::string& to, Interval& out) {
  return parse_number(from, out.from_s) == NumberFault::none && parse_number(to, out.to_s) == NumberFault::none &&
         out.from_s >= 0.0 && out.from_s <= out.to_s;
}

RecordedCamera recorded(const MountedCamera<double, RadTanCamera>& mount, const SimulatedCameras& cameras) {
  const RadTanCamerad& c = mount.camera;
  RecordedCamera out;
  out.width = static_cast<int>(cameras.width), out.height = static_cast<int>(cameras.height);
  out.fx = c.fx, out.fy = c.fy, out.cx = c.cx, out.cy = c.cy;
  out.k1 = c.k1, out.k2 = c.k2, out.p1 = c.p1, out.p2 = c.p2;
  out.R_body_camera = mount.R_body_camera;
  out.p_body_camera = mount.t_body_camera;
  return out;
}

RecordedImuNoise recorded(const SimulatedImu& imu) {
  // A recording's densities are above 0, also where there is no noise.
  const auto positive = [](double x) { return std::max(x, 1e-12); };
  return {imu.timing.rate_hz, positive(imu.noise.gyro), positive(imu.noise.gyro_walk), positive(imu.noise.accel),
          positive(imu.noise.accel_walk)};
}

void add_frame(const SimulatedMeasurement& m, Recording& out) {
  if (m.features.empty()) return;  // no row, no frame
  const auto number = static_cast<std::int64_t>(out.frames.size());
  out.frames.push_back({m.stamp, number, out.observations.size(), m.features.size()});
  for (const FeatureObservation& f : m.features)
    out.observations.push_back({f.track, f.pixel0[0], f.pixel0[1], f.has_right, f.pixel1[0], f.pixel1[1]});
}

// The first eight columns of each line.
std::string eight_columns(const std::string& text) {
  std::string out;
  TextScanner lines(text);
  while (lines.next_line()) {
    for (int column = 0; column < 8 && !lines.at_end_of_line(); ++column) {
      if (column > 0) out += ' ';
      out += lines.token();
    }
    out += '\n';
  }
  return out;
}

}  // namespace

Result<Interval> parse_interval(const std::string& text) {
  Interval out;
  const std::vector<std::string> parts = split(text);
  if (parts.size() == 2 && parse_times(parts[0], parts[1], out)) return out;
  return Error{ErrorCode::bad_input, "expected FROM:TO in seconds, found " + quote_token(text)};
}

Result<SimulatedFault> parse_fault(const std::string& text) {
  const auto refuse = [&](const std::string& expected) {
    return Error{ErrorCode::bad_input, "--fault: expected " + expected + ", found " + quote_token(text)};
  };
  const std::vector<std::string> parts = split(text);
  if (parts.size() != 4 && parts.size() != 5) return refuse("KIND:SENSOR:FROM:TO[:SHARE]");
  SimulatedFault fault;
  const auto kind = named(kKinds, parts[0]);
  const auto sensor = named(kRecorded, parts[1]);
  if (!kind) return refuse("a kind out of dropout, outlier, blind, saturation");
  if (!sensor) return refuse("imu or camera");
  if ((*kind == SimulatedFaultKind::blind && *sensor != SimulatedSensor::camera) ||
      (*kind == SimulatedFaultKind::saturation && *sensor != SimulatedSensor::imu))
    return refuse("blind:camera and saturation:imu");
  fault.kind = *kind, fault.sensor = *sensor;
  if (!parse_times(parts[2], parts[3], fault.when)) return refuse("times FROM:TO in seconds");
  if (parts.size() == 4) return fault;
  double& share = *kind == SimulatedFaultKind::saturation ? fault.range : fault.share;
  if (parse_number(parts[4], share) != NumberFault::none || !(share > 0.0 && share <= 1.0))
    return refuse("a share above 0, at most 1");
  return fault;
}

Result<std::vector<StampedPose>> read_poses(const std::string& path) {
  const Result<std::string> text = read_text_file(path);
  if (!text) return text.error();
  TextScanner first(*text);
  int columns = 0;
  if (first.next_line())
    while (!first.at_end_of_line() && !first.token().empty()) ++columns;
  const auto file = columns > 8 && columns != 12 ? parse_trajectory(eight_columns(*text), path, StampOrder::rising)
                                                 : parse_trajectory(*text, path, StampOrder::rising);
  if (!file) return file.error();
  if (!file->stamped) return Error{ErrorCode::bad_input, "expected `t x y z qx qy qz qw`, found no stamps", path, 1};
  std::vector<StampedPose> poses;
  for (const TumPose& p : file->poses) poses.push_back({p.time, {Rot3d{p.qx, p.qy, p.qz, p.qw}, p.p}});
  return poses;
}

Recording record(SimulatedWorld& world, std::string name, std::string origin) {
  Recording out;
  out.name = std::move(name);
  out.origin = std::move(origin);
  const SimulatedWorldOptions& o = world.options();
  out.imu_noise = recorded(o.imu);
  for (int c = 0; c < (o.cameras.stereo ? 2 : 1); ++c)
    out.cameras.push_back(recorded(world.rig().cameras[c], o.cameras));
  for (SimulatedMeasurement m; world.next(m);) {
    if (m.sensor == SimulatedSensor::imu) out.imu.push_back({m.stamp, m.imu.gyro, m.imu.accel});
    if (m.sensor != SimulatedSensor::camera) continue;
    add_frame(m, out);
    const Pose3d T = world.truth(m.stamp).T_world_body;
    out.groundtruth.push_back({m.stamp, T.t, T.R.qx, T.R.qy, T.R.qz, T.R.qw});
  }
  return out;
}

}  // namespace oriel::apps
