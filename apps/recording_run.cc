#include "apps/recording_run.h"

#include <limits>

#include "apps/engine_choice.h"
#include "oriel/base/percentile.h"
#include "oriel/evaluate/associate.h"
#include "oriel/evaluate/ate.h"
#include "oriel/run/beside_engine.h"
#include "oriel/run/window_solver.h"

namespace oriel::apps {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr Duration kMaxStampDifference{10'000'000};  // of an estimate and its truth [ns]

}  // namespace

ImuNoise noise_of(const RecordedImuNoise& n) {
  return {n.gyroscope_noise_density, n.accelerometer_noise_density, n.gyroscope_random_walk,
          n.accelerometer_random_walk};
}

TumPose tum_of(Time time, const Pose3d& T) { return {time, T.t, T.R.qx, T.R.qy, T.R.qz, T.R.qw}; }

std::vector<TumPose> tum_of(const Trajectory& trajectory) {
  std::vector<TumPose> out;
  for (const auto& [time, T] : trajectory.poses()) out.push_back(tum_of(time, T));
  return out;
}

void features_of(const Recording& recording, const RecordedFrame& frame, std::vector<FeatureObservation>& out) {
  out.clear();
  for (const RecordedObservation& o : recording.observations_of(frame))
    out.push_back({o.track_id, {{o.u0, o.v0}}, {{o.u1, o.v1}}, o.has_right});
}

Result<void> place_solves(WindowCore& core, const SolvePlace& place, const ExecutorOptions& worker) {
  const bool beside = place.executor != ExecutorKind::in_place;
  if (place.engine != "native" && (beside || place.defer))
    return Error{
        ErrorCode::bad_input,
        "expected the engine native where the executor is not inline or solves are deferred, found " + place.engine};
  if (place.defer) {
    auto solver = WindowSolver::make(core.followed(), place.executor, worker, worker.retries);
    if (!solver) return solver.error();
    return core.defer_to(std::move(*solver));
  }
  if (beside) {
    auto engine = BesideEngine::make(core.followed(), place.executor, worker, worker.retries);
    if (!engine) return engine.error();
    return core.use(std::move(*engine));
  }
  return place.engine == "native" ? Result<void>{} : core.use(make_engine(place.engine, core.followed()));
}

Result<std::optional<Zygote>> zygote_for(ExecutorKind executor, const TaskOps& task) {
  if (executor != ExecutorKind::process) return std::optional<Zygote>();
  Result<Zygote> zygote = Zygote::start({&task});
  if (zygote) return std::optional<Zygote>(std::move(*zygote));
  Error error = zygote.error();
  if (error.code == ErrorCode::conflict)
    error.message +=
        " (a library that makes threads before main, as OpenBLAS does, is told not to by OPENBLAS_NUM_THREADS=1)";
  return error;
}

void judge(const Recording& recording, const Trajectory& causal, const Trajectory& final, RunReport& report) {
  report.causal = tum_of(causal);
  report.final = tum_of(final);
  report.states = static_cast<std::int64_t>(report.causal.size());
  report.path_m = path_length(report.causal);
  report.ate_m = report.ate_final_m = report.ate_deg = kNone;
  const std::vector<TumPose>& truth = recording.groundtruth;
  const auto pairs = nearest_stamps(report.causal, truth, kMaxStampDifference);
  if (pairs.empty()) return;
  report.path_m =
      path_length(std::span(truth).subspan(pairs.front().truth, pairs.back().truth - pairs.front().truth + 1));
  if (const auto error = absolute_error(report.causal, truth, pairs, Alignment::se3)) {
    report.ate_m = error->position.rmse;
    report.ate_deg = error->orientation.rmse;
  }
  if (const auto error =
          absolute_error(report.final, truth, nearest_stamps(report.final, truth, kMaxStampDifference), Alignment::se3))
    report.ate_final_m = error->position.rmse;
}

void report_refusals(const WindowCore& core, RunReport& report) {
  const RefusedSolves& refused = core.refused_solves();
  report.solves_refused = refused.count;
  if (refused.count == 0) return;
  const std::string solves =
      refused.count == 1 ? "one solve was refused" : std::to_string(refused.count) + " solves were refused";
  report.warnings.insert(report.warnings.begin(), solves + "; the first: " + refused.first);
}

void judge_times(std::vector<double>& milliseconds, RunReport& report) {
  std::sort(milliseconds.begin(), milliseconds.end());
  report.updates = static_cast<std::int64_t>(milliseconds.size());
  report.update_ms_p50 = percentile(milliseconds, 0.5);
  report.update_ms_p99 = percentile(milliseconds, 0.99);
  report.update_ms_p999 = percentile(milliseconds, 0.999);
  report.update_ms_max = percentile(milliseconds, 1.0);
}

}  // namespace oriel::apps
