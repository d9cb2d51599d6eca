#include "oriel/io/recording.h"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

#include "oriel/io/camera_frame.h"
#include "oriel/io/recording_files.h"
#include "oriel/io/text.h"
#include "oriel/io/yaml_fields.h"

namespace oriel {
namespace {

namespace fs = std::filesystem;
using io_detail::YamlFields;

constexpr const char* kIndexFile = "recording.yaml";
constexpr const char* kImuFile = "imu.csv";
constexpr const char* kTracksFile = "tracks.csv";
constexpr const char* kTruthFile = "groundtruth.tum";

struct FileNames {
  std::string imu, tracks, groundtruth;  // relative to the folder; no IMU, no ground truth: empty
};

Result<void> read_files(const YAML::Node& node, const std::string& file, FileNames& out) {
  YamlFields fields(node, file, "files");
  fields.allow_only({"imu", "tracks", "groundtruth"});
  if (fields.has("imu")) fields.text("imu", out.imu);
  fields.text("tracks", out.tracks);
  if (fields.has("groundtruth")) fields.text("groundtruth", out.groundtruth);
  if (!fields.ok()) return fields.error();
  return {};
}

Result<void> read_noise(const YAML::Node& node, const std::string& file, RecordedImuNoise& out) {
  YamlFields fields(node, file, "imu");
  fields.allow_only({"rate_hz", "gyroscope_noise_density", "gyroscope_random_walk", "accelerometer_noise_density",
                     "accelerometer_random_walk"});
  fields.positive("rate_hz", out.rate_hz);
  fields.positive("gyroscope_noise_density", out.gyroscope_noise_density);
  fields.positive("gyroscope_random_walk", out.gyroscope_random_walk);
  fields.positive("accelerometer_noise_density", out.accelerometer_noise_density);
  fields.positive("accelerometer_random_walk", out.accelerometer_random_walk);
  if (!fields.ok()) return fields.error();
  return {};
}

void read_pixel_sigma(YamlFields& fields, RecordedCamera& out) {
  std::vector<double> sigma;
  fields.numbers("pixel_sigma", 2, sigma);
  if (!fields.ok()) return;
  if (!(sigma[0] > 0 && sigma[1] > 0)) return fields.fail("pixel_sigma", "expected two positive numbers [px]");
  out.pixel_sigma = {{sigma[0], sigma[1]}};
}

Result<void> read_camera(const YAML::Node& node, const std::string& file, std::size_t i, RecordedCamera& out) {
  YamlFields fields(node, file, "camera " + std::to_string(i));
  fields.allow_only({"model", "resolution", "intrinsics", "distortion", "T_body_camera", "pixel_sigma"});
  std::string model;
  fields.text("model", model);
  if (fields.ok() && model != "pinhole-radtan")
    fields.fail("model", "expected pinhole-radtan, found " + quote_token(model));
  io_detail::read_pinhole_radtan(fields, {"resolution", "intrinsics", "distortion", true}, out);
  if (fields.has("pixel_sigma")) read_pixel_sigma(fields, out);
  std::vector<double> T;
  fields.numbers("T_body_camera", 12, T);
  if (fields.ok() && !io_detail::set_camera_frame(T, out))
    fields.fail("T_body_camera", "expected three rows [R | p] with a rotation R");
  if (!fields.ok()) return fields.error();
  return {};
}

Result<void> read_index(const std::string& path, Recording& recording, FileNames& names) {
  Result<std::string> text = read_text_file(path);
  if (!text) return text.error();
  const Result<YAML::Node> root = io_detail::parse_yaml(std::move(*text), path);
  if (!root) return root.error();
  YamlFields fields(*root, path, "recording");
  fields.allow_only({"format", "name", "origin", "files", "imu", "cameras"});
  std::string format;
  fields.text("format", format);
  if (fields.ok() && format != kRecordingFormat)
    fields.fail("format", "expected format " + std::string(kRecordingFormat) + ", found " + quote_token(format));
  fields.text("name", recording.name);
  fields.text("origin", recording.origin);
  const YAML::Node files = fields.child("files"), cameras = fields.child("cameras");
  if (fields.ok() && (!cameras.IsSequence() || cameras.size() < 1 || cameras.size() > 2))
    fields.fail("cameras", "expected a list of one or two cameras");
  if (!fields.ok()) return fields.error();
  if (auto done = read_files(files, path, names); !done) return done;
  if (fields.has("imu") == names.imu.empty())
    fields.fail("files", "expected the noise `imu` and the file `files.imu` both, or neither");
  if (!fields.ok()) return fields.error();
  if (fields.has("imu"))
    if (auto done = read_noise(fields.child("imu"), path, recording.imu_noise); !done) return done;
  recording.cameras.resize(cameras.size());
  for (std::size_t i = 0; i < cameras.size(); ++i)
    if (auto done = read_camera(cameras[i], path, i, recording.cameras[i]); !done) return done;
  return {};
}

std::string list_of(std::initializer_list<double> values) {
  std::string out = "[";
  for (double value : values) {
    if (out.size() > 1) out += ", ";
    append_number(out, value);
  }
  return out + "]";
}

void append_camera(std::string& out, const RecordedCamera& c) {
  const Mat3d& R = c.R_body_camera;
  const Vec3d& p = c.p_body_camera;
  out += "  - model: pinhole-radtan\n";
  if (c.width > 0)
    out += "    resolution: " + list_of({static_cast<double>(c.width), static_cast<double>(c.height)}) + "  # [px]\n";
  out += "    intrinsics: " + list_of({c.fx, c.fy, c.cx, c.cy}) +
         "  # fx fy cx cy [px]\n    distortion: " + list_of({c.k1, c.k2, c.p1, c.p2}) +
         "  # k1 k2 p1 p2\n    T_body_camera: " +  // rows of [R | p]
         list_of({R(0, 0), R(0, 1), R(0, 2), p[0], R(1, 0), R(1, 1), R(1, 2), p[1], R(2, 0), R(2, 1), R(2, 2), p[2]}) +
         "  # rows of [R | p m]\n";
  if (c.pixel_sigma[0] > 0)
    out += "    pixel_sigma: " + list_of({c.pixel_sigma[0], c.pixel_sigma[1]}) + "  # u v [px]\n";
}

// Text in double quotes, as YAML has it.
std::string yaml_text(const std::string& text) {
  std::string out = "\"";
  for (char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += static_cast<unsigned char>(c) < ' ' ? ' ' : c;
  }
  return out + "\"";
}

void append_noise(std::string& out, const RecordedImuNoise& noise) {
  out += "imu:\n";
  const auto line = [&](const char* key, double value, const char* unit) {
    out += std::string("  ") + key + ": ";
    append_number(out, value);
    out += std::string("  # ") + unit + "\n";
  };
  line("rate_hz", noise.rate_hz, "[Hz]");
  line("gyroscope_noise_density", noise.gyroscope_noise_density, "[rad/s/sqrt(Hz)]");
  line("gyroscope_random_walk", noise.gyroscope_random_walk, "[rad/s^2/sqrt(Hz)]");
  line("accelerometer_noise_density", noise.accelerometer_noise_density, "[m/s^2/sqrt(Hz)]");
  line("accelerometer_random_walk", noise.accelerometer_random_walk, "[m/s^3/sqrt(Hz)]");
}

std::string format_index(const Recording& r) {
  std::string out = "format: " + std::string(kRecordingFormat) + "\nname: " + yaml_text(r.name) +
                    "\norigin: " + yaml_text(r.origin) + "\nfiles:\n";
  if (!r.imu.empty()) out += std::string("  imu: ") + kImuFile + "\n";
  out += std::string("  tracks: ") + kTracksFile + "\n";
  if (!r.groundtruth.empty()) out += std::string("  groundtruth: ") + kTruthFile + "\n";
  if (!r.imu.empty()) append_noise(out, r.imu_noise);
  out += "cameras:\n";
  for (const RecordedCamera& camera : r.cameras) append_camera(out, camera);
  return out;
}

std::string format_imu(const std::vector<RecordedImu>& samples) {
  std::string out = "timestamp_ns,wx,wy,wz,ax,ay,az\n";
  for (const RecordedImu& s : samples) {
    append_number(out, s.time.ns);
    for (double value : {s.gyro[0], s.gyro[1], s.gyro[2], s.accel[0], s.accel[1], s.accel[2]}) {
      out += ',';
      append_number(out, value);
    }
    out += '\n';
  }
  return out;
}

std::string format_tracks(const Recording& r) {
  std::string out = "timestamp_ns,frame,track_id,u0,v0,u1,v1\n";
  for (const RecordedFrame& frame : r.frames)
    for (const RecordedObservation& o : r.observations_of(frame)) {
      for (std::int64_t value : {frame.time.ns, frame.number, o.track_id}) {
        append_number(out, value);
        out += ',';
      }
      append_number(out, o.u0);
      out += ',';
      append_number(out, o.v0);
      out += ',';
      if (o.has_right) append_number(out, o.u1);
      out += ',';
      if (o.has_right) append_number(out, o.v1);
      out += '\n';
    }
  return out;
}

// A folder may be replaced where nothing but a recording is lost.
Result<void> check_replaceable(const fs::path& folder) {
  std::error_code code;
  const fs::file_status status = fs::status(folder, code);
  if (!fs::exists(status)) return {};
  const Error refusal{ErrorCode::io, "expected a new folder or a recording, found something else; not overwritten",
                      folder.string()};
  if (!fs::is_directory(status)) return refusal;
  fs::directory_iterator entries(folder, code);
  if (code) return Error{ErrorCode::io, "cannot be read: " + code.message(), folder.string()};
  bool empty = true;
  for (const fs::directory_entry& entry : entries) {
    const std::string name = entry.path().filename().string();
    if (name != kIndexFile && name != kImuFile && name != kTracksFile && name != kTruthFile) return refusal;
    empty = false;
  }
  if (empty || fs::exists(folder / kIndexFile, code)) return {};
  return refusal;
}

Result<void> write_files(const fs::path& folder, const Recording& r) {
  if (!r.imu.empty())
    if (auto done = write_text_file((folder / kImuFile).string(), format_imu(r.imu)); !done) return done;
  if (auto done = write_text_file((folder / kTracksFile).string(), format_tracks(r)); !done) return done;
  if (!r.groundtruth.empty())
    if (auto done = write_tum((folder / kTruthFile).string(), r.groundtruth); !done) return done;
  return write_text_file((folder / kIndexFile).string(), format_index(r));
}

}  // namespace

namespace io_detail {

Result<void> read_imu_into(const std::string& path, Recording& recording) {
  const Result<std::string> text = read_text_file(path);
  if (!text) return text.error();
  Result<std::vector<RecordedImu>> imu = parse_imu_csv(*text, path);
  if (!imu) return imu.error();
  recording.imu = std::move(*imu);
  return {};
}

Result<void> read_tracks_into(const std::string& path, Recording& recording) {
  const Result<std::string> text = read_text_file(path);
  if (!text) return text.error();
  Result<RecordedTracks> tracks = parse_tracks_csv(*text, path, recording.cameras.size());
  if (!tracks) return tracks.error();
  recording.frames = std::move(tracks->frames);
  recording.observations = std::move(tracks->observations);
  return {};
}

Result<void> read_truth_into(const std::string& path, Recording& recording) {
  const Result<std::string> text = read_text_file(path);
  if (!text) return text.error();
  Result<std::vector<TumPose>> truth = parse_groundtruth(*text, path);
  if (!truth) return truth.error();
  recording.groundtruth = std::move(*truth);
  return {};
}

}  // namespace io_detail

Result<Recording> read_recording(const std::string& folder) {
  const fs::path root(folder);
  std::error_code code;
  if (!fs::exists(root, code)) return Error{ErrorCode::not_found, "expected a recording, found no such folder", folder};
  if (!fs::is_directory(root, code))
    return Error{ErrorCode::bad_input, "expected a folder with a recording.yaml", folder};
  Recording recording;
  FileNames names;
  if (auto done = read_index((root / kIndexFile).string(), recording, names); !done) return done.error();

  if (!names.imu.empty())
    if (auto ok = io_detail::read_imu_into((root / names.imu).string(), recording); !ok) return ok.error();
  if (auto ok = io_detail::read_tracks_into((root / names.tracks).string(), recording); !ok) return ok.error();
  if (!names.groundtruth.empty())
    if (auto ok = io_detail::read_truth_into((root / names.groundtruth).string(), recording); !ok) return ok.error();
  return recording;
}

Result<void> write_recording(const std::string& folder, const Recording& recording) {
  fs::path target(folder);
  if (!target.has_filename()) target = target.parent_path();  // "name/" is the folder "name"
  if (auto done = check_replaceable(target); !done) return done;
  const fs::path fresh = target.string() + ".partial-" + std::to_string(::getpid());
  std::error_code code, ignored;
  fs::create_directories(fresh, code);
  if (code) return Error{ErrorCode::io, "cannot be made: " + code.message(), folder};
  Result<void> done = write_files(fresh, recording);
  if (done) {
    fs::remove_all(target, code);  // empty, or a recording that is being replaced
    if (!code) fs::rename(fresh, target, code);
    if (code) done = Error{ErrorCode::io, "cannot be written: " + code.message(), folder};
  }
  if (!done) fs::remove_all(fresh, ignored);
  return done;
}

}  // namespace oriel
