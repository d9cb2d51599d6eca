#include "apps/run_recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "apps/command.h"
#include "apps/engine_choice.h"
#include "apps/recording_rig.h"
#include "oriel/base/percentile.h"
#include "oriel/evaluate/associate.h"
#include "oriel/evaluate/ate.h"
#include "oriel/io/journal.h"
#include "oriel/run/beside_engine.h"
#include "oriel/testing/allocation_counter.h"
#include "oriel/window/inertial_odometry.h"

namespace oriel::apps {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr Duration kMaxStampDifference{10'000'000};  // of an estimate and its truth [ns]
constexpr std::size_t kMostWarnings = 20;

ImuNoise noise_of(const RecordedImuNoise& n) {
  return {n.gyroscope_noise_density, n.accelerometer_noise_density, n.gyroscope_random_walk,
          n.accelerometer_random_walk};
}

std::vector<TumPose> tum_of(const Trajectory& trajectory) {
  std::vector<TumPose> out;
  for (const auto& [time, T] : trajectory.poses()) out.push_back({time, T.t, T.R.qx, T.R.qy, T.R.qz, T.R.qw});
  return out;
}

// Writes down what the window does.
struct Recorder final : WindowObserver {
  explicit Recorder(JournalWriter&& j) : journal(std::move(j)) {}
  void edited() override { journal.edited(); }
  void solved(const SolveOptions& options, const SolverState& before, const Summary& summary,
              const NativeEngine& engine) override {
    journal.solved(options, before, summary, engine);
  }
  JournalWriter journal;
};

// Drives the odometry through a recording and keeps the books.
class Run {
 public:
  Run(const Recording& recording, const RunOptions& options)
      : recording_(recording),
        options_(options),
        odometry_(rig_of(recording), recording.cameras.size() > 1, noise_of(recording.imu_noise), options.odometry) {
    report_.recording = recording.name;
    report_.duration_s = (recording.frames.back().time - recording.frames.front().time).seconds();
    report_.initialised_after_s = kNone;
    milliseconds_.reserve(recording.frames.size());
  }

  Result<RunReport> operator()() {
    if (auto ok = choose_engine(); !ok) return ok.error();
    if (auto ok = open_journal(); !ok) return ok.error();
    for (const RecordedFrame& frame : recording_.frames) {
      feed_imu(frame.time);
      update(frame);
      if (options_.progress) show_progress(frame);
    }
    if (options_.progress) std::fputs("\n", stderr);
    summarize();
    judge();
    if (recorder_)
      if (auto ok = recorder_->journal.close(); !ok) return ok.error();
    return std::move(report_);
  }

 private:
  Result<void> choose_engine() {
    const bool beside = options_.executor != ExecutorKind::in_place;
    if (options_.engine == "native" && !beside) return {};
    if (!options_.journal.empty())
      return Error{ErrorCode::bad_input,
                   "--journal: expected --engine native and --executor inline, whose solves can be replayed"};
    if (beside && options_.engine != "native")
      return Error{ErrorCode::bad_input, "--executor: expected --engine native where it is not inline"};
    if (beside) {
      auto engine = BesideEngine::make(odometry_.window().followed(), options_.executor, options_.worker);
      if (!engine) return engine.error();
      return odometry_.window().use(std::move(*engine));
    }
    return odometry_.window().use(make_engine(options_.engine, odometry_.window().followed()));
  }

  Result<void> open_journal() {
    if (options_.journal.empty()) return {};
    Result<JournalWriter> journal = JournalWriter::create(options_.journal, odometry_.window().followed());
    if (!journal) return journal.error();
    recorder_ = std::make_unique<Recorder>(std::move(*journal));
    odometry_.window().observe(recorder_.get());
    return {};
  }

  // Up to the first sample at or after the frame: the motion is interpolated to the frame's own time. After a gap that
  // sample is the future, and waits.
  void feed_imu(Time until) {
    while (next_imu_ < recording_.imu.size()) {
      const RecordedImu& s = recording_.imu[next_imu_];
      if (s.time > until + PreintegrationOptions{}.max_gap) break;
      ++next_imu_;
      if (auto ok = odometry_.add_imu({s.time, s.gyro, s.accel}); !ok) warn(ok.error().text());
      if (s.time >= until) break;
    }
  }

  void update(const RecordedFrame& frame) {
    features_.clear();
    for (const RecordedObservation& o : recording_.observations_of(frame))
      features_.push_back({o.track_id, {{o.u0, o.v0}}, {{o.u1, o.v1}}, o.has_right});
    const std::int64_t allocations = allocation_count();
    const auto began = std::chrono::steady_clock::now();
    last_ = odometry_.update({frame.time, features_});
    milliseconds_.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - began).count());
    if (steady_) {
      ++steady_updates_;
      steady_allocations_ += allocation_count() - allocations;
    }
    steady_ = steady_ || odometry_.left() > 0;
    count(frame);
  }

  void count(const RecordedFrame& frame) {
    using Status = UpdateReport::Status;
    if (last_.status == Status::initialised && std::isnan(report_.initialised_after_s))
      report_.initialised_after_s = (frame.time - recording_.frames.front().time).seconds();
    if (!std::isnan(report_.initialised_after_s)) {
      ++frames_after_;
      estimated_ += last_.status == Status::initialised || last_.status == Status::tracking ? 1 : 0;
    }
    if (last_.without_imu.ns > 0 && last_.status == Status::tracking)
      warn(fmt::format("frame {}: no IMU samples for {:.2f} s before it; carried on by the cameras", frame.number,
                       last_.without_imu.seconds()));
    if (last_.reset[0] != '\0') warn(fmt::format("frame {}: the window began anew: {}", frame.number, last_.reset));
    if (last_.status == Status::failed || (last_.status == Status::initialising && frames_after_ > 0))
      warn(fmt::format("frame {}: {}", frame.number, last_.reason));
  }

  void warn(std::string text) {
    if (report_.warnings.size() < kMostWarnings) report_.warnings.push_back(std::move(text));
  }

  void show_progress(const RecordedFrame& frame) const {
    const double t = (frame.time - recording_.frames.front().time).seconds();
    std::fprintf(stderr, "\r%s: frame %zu of %zu, %.1f of %.1f s, %d landmarks, %.2f ms  ", recording_.name.c_str(),
                 milliseconds_.size(), recording_.frames.size(), t, report_.duration_s, last_.landmarks,
                 milliseconds_.back());
  }

  void summarize() {
    std::sort(milliseconds_.begin(), milliseconds_.end());
    report_.updates = static_cast<std::int64_t>(milliseconds_.size());
    report_.update_ms_p50 = percentile(milliseconds_, 0.5);
    report_.update_ms_p99 = percentile(milliseconds_, 0.99);
    report_.update_ms_p999 = percentile(milliseconds_, 0.999);
    report_.update_ms_max = percentile(milliseconds_, 1.0);
    report_.coverage = frames_after_ > 0 ? static_cast<double>(estimated_) / static_cast<double>(frames_after_) : 0.0;
    report_.allocations_per_update =
        steady_updates_ > 0 ? static_cast<double>(steady_allocations_) / static_cast<double>(steady_updates_) : kNone;
    for (std::size_t k = 0; k < kDropReasonNames.size(); ++k)
      report_.dropped.emplace_back(kDropReasonNames[k], odometry_.dropped()[k]);
    report_.peak_rss_mb = peak_rss_mb();
    if (frames_after_ == 0) warn(fmt::format("never initialised: {}", last_.reason));
  }

  void judge() {
    report_.causal = tum_of(odometry_.causal());
    report_.final = tum_of(odometry_.final());
    report_.states = static_cast<std::int64_t>(report_.causal.size());
    report_.path_m = path_length(report_.causal);
    report_.ate_m = report_.ate_final_m = report_.ate_deg = kNone;
    const std::vector<TumPose>& truth = recording_.groundtruth;
    const auto pairs = nearest_stamps(report_.causal, truth, kMaxStampDifference);
    if (pairs.empty()) return;
    report_.path_m =
        path_length(std::span(truth).subspan(pairs.front().truth, pairs.back().truth - pairs.front().truth + 1));
    if (const auto error = absolute_error(report_.causal, truth, pairs, Alignment::se3)) {
      report_.ate_m = error->position.rmse;
      report_.ate_deg = error->orientation.rmse;
    }
    if (const auto error = absolute_error(report_.final, truth,
                                          nearest_stamps(report_.final, truth, kMaxStampDifference), Alignment::se3))
      report_.ate_final_m = error->position.rmse;
  }

  const Recording& recording_;
  const RunOptions& options_;
  InertialOdometry odometry_;
  std::unique_ptr<Recorder> recorder_;  // stands on the odometry's graph
  RunReport report_;
  UpdateReport last_;
  std::size_t next_imu_ = 0;
  bool steady_ = false;  // the first state has left: the window is full
  std::int64_t frames_after_ = 0, estimated_ = 0, steady_updates_ = 0, steady_allocations_ = 0;
  std::vector<double> milliseconds_;
  std::vector<FeatureObservation> features_;
};

}  // namespace

Result<RunReport> run_recording(const Recording& recording, const RunOptions& options) {
  if (recording.cameras.empty() || recording.imu.empty() || recording.frames.empty())
    return Error{ErrorCode::bad_input, "expected a recording with a camera, IMU samples and frames", recording.name, 0};
  return Run(recording, options)();
}

}  // namespace oriel::apps
