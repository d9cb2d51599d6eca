#include "oriel/io/euroc_import.h"

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

// T_BS maps sensor to body: p_B = T_BS·p_S, sixteen numbers row by row.
void read_T_BS(YamlFields& fields, const std::string& path, std::vector<double>& rows) {
  const YAML::Node node = fields.child("T_BS");
  if (!fields.ok()) return;
  YamlFields matrix(node, path, "T_BS");
  matrix.numbers("data", 16, rows);
  if (!matrix.ok()) return fields.fail("T_BS", matrix.error().message);
  for (std::size_t j = 0; j < 4; ++j)
    if (rows[12 + j] != (j == 3 ? 1 : 0)) return fields.fail("T_BS", "expected a last row of 0, 0, 0, 1");
}

void expect_text(YamlFields& fields, const char* key, const std::string& expected) {
  std::string found;
  fields.text(key, found);
  if (fields.ok() && found != expected)
    fields.fail(key, std::string("expected ") + key + " " + expected + ", found " + quote_token(found));
}

Result<YAML::Node> read_yaml(const std::string& path) {
  Result<std::string> text = read_text_file(path);
  if (!text) return text.error();
  return io_detail::parse_yaml(std::move(*text), path);
}

Result<RecordedCamera> read_camera(const std::string& path, const std::string& name) {
  const Result<YAML::Node> root = read_yaml(path);
  if (!root) return root.error();
  YamlFields fields(*root, path, name);
  expect_text(fields, "camera_model", "pinhole");
  expect_text(fields, "distortion_model", "radial-tangential");
  RecordedCamera camera;
  io_detail::read_pinhole_radtan(fields, {"resolution", "intrinsics", "distortion_coefficients"}, camera);
  std::vector<double> T;
  read_T_BS(fields, path, T);
  if (fields.ok() && !io_detail::set_camera_frame(T, camera))
    fields.fail("T_BS", "expected a rotation and a translation");
  if (!fields.ok()) return fields.error();
  return camera;
}

Result<RecordedImuNoise> read_noise(const std::string& path) {
  const Result<YAML::Node> root = read_yaml(path);
  if (!root) return root.error();
  YamlFields fields(*root, path, "imu0");
  RecordedImuNoise noise;
  fields.positive("rate_hz", noise.rate_hz);
  fields.positive("gyroscope_noise_density", noise.gyroscope_noise_density);
  fields.positive("gyroscope_random_walk", noise.gyroscope_random_walk);
  fields.positive("accelerometer_noise_density", noise.accelerometer_noise_density);
  fields.positive("accelerometer_random_walk", noise.accelerometer_random_walk);
  std::vector<double> T;
  read_T_BS(fields, path, T);
  for (std::size_t i = 0; fields.ok() && i < 16; ++i)
    if (T[i] != (i % 5 == 0 ? 1 : 0)) fields.fail("T_BS", "expected the identity, as body frame = IMU frame");
  if (!fields.ok()) return fields.error();
  return noise;
}

Result<void> read_calibration(const fs::path& root, Recording& recording) {
  const Result<RecordedImuNoise> noise = read_noise((root / "imu0_sensor.yaml").string());
  if (!noise) return noise.error();
  recording.imu_noise = *noise;
  for (const char* name : {"cam0", "cam1"}) {
    const fs::path path = root / (std::string(name) + "_sensor.yaml");
    std::error_code code;
    if (!recording.cameras.empty() && !fs::exists(path, code)) break;  // one camera
    const Result<RecordedCamera> camera = read_camera(path.string(), name);
    if (!camera) return camera.error();
    recording.cameras.push_back(*camera);
  }
  return {};
}

}  // namespace

Result<Recording> read_euroc(const std::string& source_folder) {
  fs::path root(source_folder);
  if (!root.has_filename()) root = root.parent_path();
  std::error_code code;
  if (!fs::is_directory(root, code))
    return Error{ErrorCode::not_found, "expected a folder with imu.csv, tracks.csv and sensor yamls, found none",
                 source_folder};
  Recording recording;
  recording.name = fs::absolute(root, code).lexically_normal().filename().string();
  recording.origin = "EuRoC MAV data set (ASL, ETH Zurich), imported from the folder " + recording.name;
  if (auto done = read_calibration(root, recording); !done) return done.error();
  if (auto ok = io_detail::read_imu_into((root / "imu.csv").string(), recording); !ok) return ok.error();
  if (auto ok = io_detail::read_tracks_into((root / "tracks.csv").string(), recording); !ok) return ok.error();
  const std::string truth_path = (root / "groundtruth.tum").string();
  if (fs::exists(truth_path, code))
    if (auto ok = io_detail::read_truth_into(truth_path, recording); !ok) return ok.error();
  return recording;
}

Result<Recording> import_euroc(const std::string& source_folder, const std::string& recording_folder) {
  Result<Recording> recording = read_euroc(source_folder);
  if (!recording) return recording;
  if (auto done = write_recording(recording_folder, *recording); !done) return done.error();
  return recording;
}

}  // namespace oriel
