#include "apps/track_recording.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/recording_rig.h"
#include "apps/recording_run.h"
#include "oriel/base/percentile.h"
#include "oriel/evaluate/associate.h"
#include "oriel/evaluate/ate.h"
#include "oriel/io/stereo_import.h"
#include "oriel/io/visual_map_file.h"

namespace oriel::apps {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr Duration kMaxStampDifference{10'000'000};  // of an estimate and its truth [ns]

std::vector<TumPose> poses_of(const MapFrames& frames) {
  std::vector<TumPose> out;
  for (std::uint32_t k = 0; k < frames.size(); ++k) out.push_back(tum_of(frames.time[k], frames.T_world_body[k]));
  return out;
}

void judge(const Recording& recording, TrackReport& report) {
  report.ate_m = report.ate_deg = kNone;
  report.path_m = path_length(report.trajectory);
  const auto pairs = nearest_stamps(report.trajectory, recording.groundtruth, kMaxStampDifference);
  if (pairs.empty()) return;
  if (const auto error = absolute_error(report.trajectory, recording.groundtruth, pairs, Alignment::se3)) {
    report.ate_m = error->position.rmse;
    report.ate_deg = error->orientation.rmse;
  }
}

Result<std::vector<double>> run(const Recording& recording, TwoFrameOdometry& odometry, bool progress) {
  std::vector<double> milliseconds;
  std::vector<FeatureObservation> features;
  for (const RecordedFrame& frame : recording.frames) {
    features_of(recording, frame, features);
    const auto began = std::chrono::steady_clock::now();
    if (auto ok = odometry.add({frame.time, features}); !ok) return ok.error();
    milliseconds.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - began).count());
    if (progress)
      std::fprintf(stderr, "\r%s: frame %zu of %zu  ", recording.name.c_str(), milliseconds.size(),
                   recording.frames.size());
  }
  odometry.finish();
  if (progress) std::fprintf(stderr, "\n");
  std::sort(milliseconds.begin(), milliseconds.end());
  return milliseconds;
}

}  // namespace

Result<TrackReport> track_recording(const Recording& recording, const RunConfig& config, Zygote* zygote,
                                    bool progress) {
  if (recording.cameras.size() != 2 || recording.frames.empty())
    return Error{ErrorCode::bad_input, "expected a recording with two cameras and frames", recording.name};
  const ExecutorOptions worker = worker_options(config, zygote);
  const std::array<Vec2d, 2> sigma = {recording.cameras[0].pixel_sigma, recording.cameras[1].pixel_sigma};
  auto odometry = TwoFrameOdometry::start(config.executor, rig_of(recording), config.two_frame, worker, sigma);
  if (!odometry) return odometry.error();
  const auto milliseconds = run(recording, *odometry, progress);
  if (!milliseconds) return milliseconds.error();
  TrackReport report;
  report.recording = recording.name;
  report.duration_s = (recording.frames.back().time - recording.frames.front().time).seconds();
  report.statistics = odometry->statistics();
  report.frame_ms_p50 = percentile(*milliseconds, 0.5);
  report.frame_ms_p99 = percentile(*milliseconds, 0.99);
  report.frame_ms_max = percentile(*milliseconds, 1.0);
  report.warnings = odometry->warnings();
  report.map = odometry->take_map();
  report.points = report.map.points.size();
  report.trajectory = poses_of(report.map.frames);
  judge(recording, report);
  return report;
}

Result<int> track_and_report(const RunConfig& config, const std::string& folder, const TrackTargets& targets) {
  for (const std::string& target : {targets.json, targets.out, targets.map})
    if (auto ok = check_target(target); !ok) return ok.error();
  auto zygote = zygote_for(config.executor, kTaskOps<TwoFrameTask>);
  if (!zygote) return zygote.error();
  const Result<Recording> recording = read_any_recording(folder);
  if (!recording) return recording.error();
  const Result<TrackReport> report =
      track_recording(*recording, config, *zygote ? &**zygote : nullptr, ::isatty(STDERR_FILENO) == 1);
  if (!report) return report.error();
  if (!targets.out.empty())
    if (auto ok = write_tum(targets.out, report->trajectory); !ok) return ok.error();
  if (!targets.map.empty())
    if (auto ok = write_visual_map(targets.map, report->map); !ok) return ok.error();
  if (!targets.json.empty())
    if (auto ok = write_output(targets.json, to_json(*report) + "\n"); !ok) return ok.error();
  if (targets.json != "-")
    if (auto ok = write_output("-", to_text(*report)); !ok) return ok.error();
  const bool any = report->statistics.frames[static_cast<std::size_t>(FrameStatus::solved)] > 0;
  return any ? kSolved : kNotConverged;
}

std::string to_json(const TrackReport& r) {
  nlohmann::ordered_json frames = nlohmann::ordered_json::object();
  for (int k = 0; k < kFrameStatuses; ++k)
    frames[std::string(name_of(static_cast<FrameStatus>(k)))] = r.statistics.frames[static_cast<std::size_t>(k)];
  const nlohmann::ordered_json json = {
      // a number that is not finite is written as null
      {"recording", r.recording},
      {"duration_s", r.duration_s},
      {"frames", frames},
      {"points", r.points},
      {"matches", r.statistics.matches},
      {"inliers", r.statistics.inliers},
      {"iterations", r.statistics.iterations},
      {"final_cost", r.statistics.final_cost},
      {"worker_restarts", r.statistics.restarts},
      {"frame_ms", {{"p50", r.frame_ms_p50}, {"p99", r.frame_ms_p99}, {"max", r.frame_ms_max}}},
      {"ate_m", r.ate_m},
      {"ate_deg", r.ate_deg},
      {"path_m", r.path_m},
      {"warnings", r.warnings}};
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

std::string to_text(const TrackReport& r) {
  const TwoFrameStatistics& s = r.statistics;
  std::string text = fmt::format("{}: {} frames in {:.1f} s:", r.recording, r.trajectory.size(), r.duration_s);
  for (int k = 0; k < kFrameStatuses; ++k)
    if (const std::int64_t n = s.frames[static_cast<std::size_t>(k)]; n > 0)
      text += fmt::format(" {} {}", n, name_of(static_cast<FrameStatus>(k)));
  text += fmt::format("; path {:.2f} m, {} points\n", r.path_m, r.points);
  text += fmt::format("  error (ATE, SE(3)-aligned): {:.4f} m and {:.3f} deg\n", r.ate_m, r.ate_deg);
  text += fmt::format("  {} of {} matches agree; {} iterations; frame: p50 {:.2f} ms, p99 {:.2f} ms, max {:.2f} ms\n",
                      s.inliers, s.matches, s.iterations, r.frame_ms_p50, r.frame_ms_p99, r.frame_ms_max);
  for (const std::string& warning : r.warnings) text += "  warning: " + warning + "\n";
  return text;
}

}  // namespace oriel::apps
