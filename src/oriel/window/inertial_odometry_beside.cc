// InertialOdometry whose solves go on beside its caller.
#include "oriel/window/inertial_odometry.h"

namespace oriel {

// A frame that is refused merges nothing.
UpdateReport InertialOdometry::track_ahead(const StereoFrame& frame) {
  UpdateReport report;
  if (is_stale(frame, report)) return report;
  const std::optional<SolvedFrame> solved = window_.has_begun() ? std::optional(merge()) : std::nullopt;
  report = solved && solved->begins_anew ? begin_anew(frame, solved->failure) : predict_frame(frame);
  report.solved = solved;
  return report;
}

UpdateReport InertialOdometry::predict_frame(const StereoFrame& frame) {
  UpdateReport report;
  report.time = frame.time;
  report.status = UpdateReport::Status::failed;
  if (!add_frame(frame, nullptr, report)) return miss(frame, report);
  missed_ = 0;
  if (auto ok = window_.begin_solve(solve_options(options_.max_iterations)); !ok) {
    report.reason = "no solve could be begun";
    if (++failed_solves_ < options_.most_failed_solves) return report;
    return begin_anew(frame, "so many solves have failed, one after the other");
  }
  fill(report);
  report.predicted = true;
  keep(causal_, frame.time, report.values.T_world_body);
  return report;
}

// What the update before began, before anything new comes in: map, timeline and graph are as they were then, so that
// what is found, and what follows from it, is what it would have been at once.
SolvedFrame InertialOdometry::merge() {
  UpdateReport report;
  report.status = UpdateReport::Status::failed;
  SolvedFrame solved;
  solved.time = timeline_.latest()->time;
  const char* why = conclude(window_.finish_solve(), report);
  solved.begins_anew = why != nullptr;
  if (solved.begins_anew)
    solved.failure = why;
  else if (report.status != UpdateReport::Status::tracking)
    solved.failure = report.reason;
  solved.values = report.values;
  solved.keyframe = report.keyframe;
  solved.iterations = report.iterations;
  return solved;
}

UpdateReport InertialOdometry::settle() {
  UpdateReport report;
  report.status = UpdateReport::Status::failed;
  report.reason = "no solve was begun";
  if (!window_.has_begun()) return report;
  report.time = timeline_.latest()->time;
  if (const char* why = conclude(window_.finish_solve(), report)) {
    restart();
    report.status = UpdateReport::Status::initialising;
    report.reason = report.reset = why;
  }
  return report;
}

// Of a start, and of a window that waits; by the same solver as all others, whose state goes on from solve to solve.
Summary InertialOdometry::solve_at_once(int iterations) {
  const SolveOptions options = solve_options(iterations);
  if (!window_.defers()) return window_.solve(options);
  if (auto ok = window_.begin_solve(options); !ok) return refused(options, ok.error());
  return window_.finish_solve();
}

}  // namespace oriel
