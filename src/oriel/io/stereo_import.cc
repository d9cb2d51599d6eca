#include "oriel/io/stereo_import.h"

#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

#include "oriel/io/camera_frame.h"
#include "oriel/io/euroc_import.h"
#include "oriel/io/gtsam_import.h"
#include "oriel/io/recording_files.h"
#include "oriel/io/text.h"
#include "oriel/io/yaml_fields.h"

namespace oriel {
namespace {

namespace fs = std::filesystem;
using io_detail::YamlFields;

void read_left(YamlFields& fields, RecordedCamera& camera) {
  fields.positive("fu", camera.fx);
  fields.positive("fv", camera.fy);
  fields.number("cu", camera.cx);
  fields.number("cv", camera.cy);
  std::vector<double> T;
  fields.numbers("T_VC", 16, T);
  if (!fields.ok()) return;
  const bool last_row = T[12] == 0 && T[13] == 0 && T[14] == 0 && T[15] == 1;
  if (!last_row || !io_detail::set_camera_frame(T, camera))
    fields.fail("T_VC", "expected a rotation, a translation and a last row of 0, 0, 0, 1");
}

void read_sigmas(YamlFields& fields, std::vector<RecordedCamera>& cameras) {
  std::vector<double> variance;
  fields.numbers("pixel_variance_px2", 4, variance);
  for (std::size_t i = 0; fields.ok() && i < 4; ++i) {
    if (!(variance[i] > 0)) return fields.fail("pixel_variance_px2", "expected four positive numbers");
    cameras[i / 2].pixel_sigma[static_cast<int>(i % 2)] = std::sqrt(variance[i]);
  }
}

Result<std::vector<RecordedCamera>> read_pair(const std::string& path) {
  Result<std::string> text = read_text_file(path);
  if (!text) return text.error();
  const Result<YAML::Node> root = io_detail::parse_yaml(std::move(*text), path);
  if (!root) return root.error();
  YamlFields fields(*root, path, "calibration");
  fields.allow_only({"fu", "fv", "cu", "cv", "baseline_m", "T_VC", "pixel_variance_px2", "gyro_variance_rad2_s2",
                     "velocity_variance_m2_s2"});
  std::vector<RecordedCamera> cameras(2);
  double baseline = 0;
  fields.positive("baseline_m", baseline);
  read_left(fields, cameras[0]);
  if (fields.ok()) {
    cameras[1] = cameras[0];
    cameras[1].p_body_camera += cameras[0].R_body_camera.col(0) * baseline;
    if (fields.has("pixel_variance_px2")) read_sigmas(fields, cameras);
  }
  if (!fields.ok()) return fields.error();
  return cameras;
}

}  // namespace

Result<Recording> read_stereo_tracks(const std::string& source_folder) {
  fs::path root(source_folder);
  if (!root.has_filename()) root = root.parent_path();
  std::error_code code;
  if (!fs::is_directory(root, code))
    return Error{ErrorCode::not_found, "expected a folder with tracks.csv and calib.yaml, found none", source_folder};
  Recording recording;
  recording.name = fs::absolute(root, code).lexically_normal().filename().string();
  recording.origin = "rectified stereo tracks, imported from the folder " + recording.name;
  Result<std::vector<RecordedCamera>> cameras = read_pair((root / "calib.yaml").string());
  if (!cameras) return cameras.error();
  recording.cameras = std::move(*cameras);
  if (auto ok = io_detail::read_tracks_into((root / "tracks.csv").string(), recording); !ok) return ok.error();
  const std::string truth_path = (root / "groundtruth.tum").string();
  if (fs::exists(truth_path, code))
    if (auto ok = io_detail::read_truth_into(truth_path, recording); !ok) return ok.error();
  return recording;
}

Result<Recording> read_any_recording(const std::string& folder) {
  const fs::path root(folder);
  std::error_code code;
  if (!fs::exists(root, code)) return Error{ErrorCode::not_found, "expected a recording, found no such folder", folder};
  if (fs::exists(root / "recording.yaml", code)) return read_recording(folder);
  if (fs::exists(root / "calib.yaml", code)) return read_stereo_tracks(folder);
  if (fs::exists(root / "cam0_sensor.yaml", code)) return read_euroc(folder);
  if (fs::exists(root / kGtsamCalibration, code)) return read_gtsam_stereo(folder);
  return Error{ErrorCode::bad_input,
               "expected a folder with recording.yaml, calib.yaml (stereo tracks), cam0_sensor.yaml (EuRoC) or " +
                   std::string(kGtsamCalibration),
               folder};
}

}  // namespace oriel
