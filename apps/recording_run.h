// What all who run a recording share: its sensors as the library has them, measurements in their order, the judgement.
#pragma once
#include <algorithm>
#include <optional>
#include <vector>

#include "apps/run_recording.h"
#include "oriel/sensor/feature_track.h"
#include "oriel/sensor/preintegration.h"
#include "oriel/window/trajectory.h"
#include "oriel/window/window_core.h"

namespace oriel::apps {

ImuNoise noise_of(const RecordedImuNoise& noise);
TumPose tum_of(Time time, const Pose3d& T_world_body);
std::vector<TumPose> tum_of(const Trajectory& trajectory);
// Overwrites `out`.
void features_of(const Recording& recording, const RecordedFrame& frame, std::vector<FeatureObservation>& out);

// Gives the samples from `next` on, up to the first at or after a frame: the motion is interpolated to the frame's own
// time. After a gap that sample is the future, and waits.
template <class Take>
void feed_imu(const Recording& recording, Time until, std::size_t& next, Take&& take) {
  while (next < recording.imu.size()) {
    const RecordedImu& s = recording.imu[next];
    if (s.time > until + PreintegrationOptions{}.max_gap) break;
    ++next;
    take(ImuSample{s.time, s.gyro, s.accel});
    if (s.time >= until) break;
  }
}

// Where a window's solves run, and whether its updates wait for them. An Error where the engine cannot be there.
struct SolvePlace {
  std::string engine = "native";
  ExecutorKind executor = ExecutorKind::in_place;
  bool defer = false;
};
Result<void> place_solves(WindowCore& core, const SolvePlace& place, const ExecutorOptions& worker);

// What workers are forked from, where the executor is a process: to be had before there is anything that a worker would
// inherit. None where it is not.
Result<std::optional<Zygote>> zygote_for(ExecutorKind executor, const TaskOps& task);

// Trajectories and their errors against the truth, if there is one.
void judge(const Recording& recording, const Trajectory& causal, const Trajectory& final, RunReport& report);
// How many of the window's solves were refused: with the words of the first, before all other warnings.
void report_refusals(const WindowCore& core, RunReport& report);
// Of the updates' times [ms], which it sorts.
void judge_times(std::vector<double>& milliseconds, RunReport& report);

}  // namespace oriel::apps
