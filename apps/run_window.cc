#include "apps/run_window.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "apps/command.h"
#include "apps/recording_rig.h"
#include "apps/recording_run.h"
#include "oriel/testing/allocation_counter.h"
#include "oriel/window/pose_recorder.h"

namespace oriel::apps {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kMostWarnings = 20;

SensorSuite sensors_of(const Recording& recording) {
  SensorSuite sensors;
  sensors.has_imu = !recording.imu.empty();
  sensors.imu = noise_of(recording.imu_noise);
  sensors.cameras = static_cast<int>(recording.cameras.size());
  sensors.rig = rig_of(recording);
  return sensors;
}

// Drives a window through a recording and keeps the books.
class WindowRun {
 public:
  WindowRun(const Recording& recording, AssembledWindow& window, bool progress)
      : recording_(recording), window_(window), poses_(window.body()), progress_(progress) {
    report_.recording = recording.name;
    report_.duration_s = (recording.frames.back().time - recording.frames.front().time).seconds();
    report_.initialised_after_s = kNone;
    milliseconds_.reserve(recording.frames.size());
    poses_.reserve(recording.frames.size());
    window.window().listen(&poses_);
  }

  RunReport operator()() {
    const auto began = std::chrono::steady_clock::now();
    for (const RecordedFrame& frame : recording_.frames) {
      feed_imu(recording_, frame.time, next_imu_, [this](const ImuSample& s) {
        if (auto ok = window_.add(s); !ok) warn(ok.error().text());
      });
      update(frame);
      if (progress_)
        std::fprintf(stderr, "\r%s: frame %zu of %zu, %.2f ms  ", recording_.name.c_str(), milliseconds_.size(),
                     recording_.frames.size(), milliseconds_.back());
    }
    if (window_.has_begun()) take(window_.window().settle(), recording_.frames.back());
    report_.frames_per_second = static_cast<double>(recording_.frames.size()) /
                                std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    if (progress_) std::fputs("\n", stderr);
    summarize();
    return std::move(report_);
  }

 private:
  void update(const RecordedFrame& frame) {
    features_of(recording_, frame, features_);
    const std::int64_t allocations = allocation_count();
    const auto began = std::chrono::steady_clock::now();
    const WindowUpdate* update = window_.update({frame.time, features_});
    milliseconds_.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - began).count());
    if (steady_) {
      ++steady_updates_;
      steady_allocations_ += allocation_count() - allocations;
    }
    if (update == nullptr) {
      ++uninitialised_;
      return;
    }
    if (std::isnan(report_.initialised_after_s)) {
      first_ = frame.time;
      report_.initialised_after_s = (frame.time - recording_.frames.front().time).seconds();
    }
    take(*update, frame);
  }

  void take(const WindowUpdate& update, const RecordedFrame& frame) {
    steady_ = steady_ || update.states_marginalized > 0;
    marginal_outliers_ += update.slide.dropped_outliers;
    marginal_invalid_ += update.slide.dropped_invalid;
    if (update.reset[0] != '\0') warn(fmt::format("frame {}: the window began anew: {}", frame.number, update.reset));
    if (update.status == WindowUpdate::Status::solve_failed)
      warn(fmt::format("frame {}: the solve failed: {}", frame.number, why(update)));
    if (update.status == WindowUpdate::Status::slide_failed)
      warn(fmt::format("frame {}: nothing could leave the window: {}", frame.number, update.error.message));
    if (update.waiting > 0 && !waits_)
      warn(fmt::format("frame {}: no motion reaches it yet; it waits, and what comes after it", frame.number));
    waits_ = update.waiting > 0;
  }

  static std::string why(const WindowUpdate& update) {
    if (!update.solve.refusal.empty()) return update.solve.refusal;
    return update.solve.failed() ? update.solve.reason_text() : update.error.message;  // the latter: none was begun
  }

  void warn(std::string text) {
    if (report_.warnings.size() < kMostWarnings) report_.warnings.push_back(std::move(text));
  }

  void summarize() {
    Trajectory causal;  // not of the frames that were held until it began: what was said of them came late
    for (const StampedPose& p : poses_.causal().poses())
      if (p.time >= first_) causal.add(p.time, p.T_world_body);
    judge(recording_, causal, poses_.final(window_.window().graph(), window_.window().states()), report_);
    judge_times(milliseconds_, report_);
    if (std::isnan(report_.initialised_after_s))
      warn(fmt::format("never initialised: {}", window_.waiting_for()));
    else
      report_.coverage = coverage();
    report_.allocations_per_update =
        steady_updates_ > 0 ? static_cast<double>(steady_allocations_) / static_cast<double>(steady_updates_) : kNone;
    report_.dropped = window_.counts();
    report_.dropped.emplace_back("marginal_outlier", marginal_outliers_);
    report_.dropped.emplace_back("marginal_invalid", marginal_invalid_);
    report_.dropped.emplace_back("uninitialised", uninitialised_);
    for (std::size_t k = 0; k < kRefusalNames.size(); ++k) {
      std::int64_t groups = 0;
      for (const Refusals& r : window_.window().refusals()) groups += r.counts[k];
      report_.dropped.emplace_back(std::string("group_") + kRefusalNames[k], groups);
    }
    report_.peak_rss_mb = peak_rss_mb();
    report_refusals(window_.window().core(), report_);
  }

  // Of the frames since it began.
  double coverage() const {
    std::int64_t frames = 0, estimated = 0;
    auto pose = report_.causal.begin();
    for (const RecordedFrame& frame : recording_.frames) {
      if (frame.time < first_) continue;
      while (pose != report_.causal.end() && pose->time < frame.time) ++pose;
      ++frames;
      estimated += pose != report_.causal.end() && pose->time == frame.time ? 1 : 0;
    }
    return static_cast<double>(estimated) / static_cast<double>(frames);
  }

  const Recording& recording_;
  AssembledWindow& window_;
  PoseRecorder poses_;
  bool progress_, waits_ = false;
  bool steady_ = false;  // the first state has left: the window is full
  RunReport report_;
  Time first_;
  std::size_t next_imu_ = 0;
  std::int64_t uninitialised_ = 0, marginal_outliers_ = 0, marginal_invalid_ = 0;
  std::int64_t steady_updates_ = 0, steady_allocations_ = 0;
  std::vector<double> milliseconds_;
  std::vector<FeatureObservation> features_;
};

}  // namespace

Result<RunReport> run_window(const Recording& recording, const RunConfig& config, const RunNames& names,
                             const ExecutorOptions& worker, bool progress) {
  if (recording.frames.empty())
    return Error{ErrorCode::bad_input, "expected a recording with frames", recording.name, 0};
  auto window = AssembledWindow::make(config.window, names, sensors_of(recording));
  if (!window) return window.error();
  if (auto ok = place_solves((*window)->window().core(), {config.engine, config.executor, config.defer}, worker); !ok)
    return ok.error();
  return WindowRun(recording, **window, progress)();
}

}  // namespace oriel::apps
