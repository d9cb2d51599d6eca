#include "apps/run_recording.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "apps/command.h"
#include "apps/front_end.h"
#include "apps/recording_rig.h"
#include "apps/recording_run.h"
#include "oriel/io/journal.h"
#include "oriel/testing/allocation_counter.h"
#include "oriel/window/inertial_odometry.h"

namespace oriel::apps {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kMostWarnings = 20;

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
    const auto began = std::chrono::steady_clock::now();
    for (const RecordedFrame& frame : recording_.frames) {
      burn_cpu(options_.front_end_ms);
      feed_imu(frame.time);
      update(frame);
      if (options_.progress) show_progress(frame);
    }
    if (options_.defer) (void)odometry_.settle();
    report_.frames_per_second = static_cast<double>(recording_.frames.size()) /
                                std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    if (options_.progress) std::fputs("\n", stderr);
    summarize();
    judge(recording_, odometry_.causal(), odometry_.final(), report_);
    if (recorder_)
      if (auto ok = recorder_->journal.close(); !ok) return ok.error();
    return std::move(report_);
  }

 private:
  Result<void> choose_engine() {
    const SolvePlace place{options_.engine, options_.executor, options_.defer};
    if (!options_.journal.empty() && place.defer)
      return Error{ErrorCode::bad_input, "--journal: expected solves that are waited for, found --defer (key `defer`)"};
    if (!options_.journal.empty() && (place.engine != "native" || place.executor != ExecutorKind::in_place))
      return Error{ErrorCode::bad_input,
                   "--journal: expected --engine native and --executor inline, whose solves can be replayed"};
    if (place.defer && place.engine != "native")
      return Error{ErrorCode::bad_input, "--defer: expected the engine native, found " + place.engine};
    return place_solves(odometry_.window(), place, options_.worker);
  }

  Result<void> open_journal() {
    if (options_.journal.empty()) return {};
    Result<JournalWriter> journal = JournalWriter::create(options_.journal, odometry_.window().followed());
    if (!journal) return journal.error();
    recorder_ = std::make_unique<Recorder>(std::move(*journal));
    odometry_.window().observe(recorder_.get());
    return {};
  }

  void feed_imu(Time until) {
    oriel::apps::feed_imu(recording_, until, next_imu_, [this](const ImuSample& s) {
      if (auto ok = odometry_.add_imu(s); !ok) warn(ok.error().text());
    });
  }

  void update(const RecordedFrame& frame) {
    features_of(recording_, frame, features_);
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
    if (last_.solved && last_.solved->failure[0] != '\0')
      warn(fmt::format("the frame before frame {}: {}", frame.number, last_.solved->failure));
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
    judge_times(milliseconds_, report_);
    report_.coverage = frames_after_ > 0 ? static_cast<double>(estimated_) / static_cast<double>(frames_after_) : 0.0;
    report_.allocations_per_update =
        steady_updates_ > 0 ? static_cast<double>(steady_allocations_) / static_cast<double>(steady_updates_) : kNone;
    for (std::size_t k = 0; k < kDropReasonNames.size(); ++k)
      report_.dropped.emplace_back(kDropReasonNames[k], odometry_.dropped()[k]);
    report_.peak_rss_mb = peak_rss_mb();
    if (frames_after_ == 0) warn(fmt::format("never initialised: {}", last_.reason));
    report_refusals(odometry_.window(), report_);
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
