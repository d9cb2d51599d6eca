// Visual odometry of a stereo camera that is nothing but two-frame tasks: each frame is found from the one before it
// that has a pose, and the map keeps what was seen. While a task runs elsewhere the next frame's points are made.
//
//     auto odometry = TwoFrameOdometry::start(ExecutorKind::thread, rig, options, executor_options).value();
//     for (const StereoFrame& frame : frames) odometry.add(frame);
//     odometry.finish();
//     odometry.map();                        // frames, points, observations
//
// The first frame whose cameras make enough points is the origin. A frame without enough matches that makes enough
// points of its own begins a chain anew, at the pose where the motion that was puts it (FrameStatus::held): what lies
// between is not measured. Other frames without a pose are flagged, and interpolated in the end.
#pragma once
#include <array>
#include <unordered_map>
#include <vector>

#include "oriel/run/executor.h"
#include "oriel/run/two_frame_task.h"
#include "oriel/sensor/feature_track.h"

namespace oriel {

struct TwoFrameStatistics {
  std::array<std::int64_t, kFrameStatuses> frames{};      // by FrameStatus
  std::int64_t matches = 0, inliers = 0, iterations = 0;  // of frames that were solved
  double final_cost = 0.0;                                // their sum
  std::int64_t restarts = 0;                              // of workers
};

class TwoFrameOdometry {
 public:
  // `pixel_sigma`: of the coordinates of both cameras [px]; 0: options.pixel_sigma. An error as Executor::start and
  // TwoFrameTask::init_context say it.
  static Result<TwoFrameOdometry> start(ExecutorKind kind, const StereoRigd& rig, const TwoFrameOptions& options,
                                        const ExecutorOptions& executor = {},
                                        const std::array<Vec2d, 2>& pixel_sigma = {Vec2d::zero(), Vec2d::zero()});

  // Returns once the frame is handed over; the pose of the one before it is then in the map. A stamp that does not rise
  // is refused, and nothing changes.
  Result<void> add(const StereoFrame& frame);
  // Waits for the last frame, and interpolates those without a pose of their own.
  void finish();

  const VisualMap& map() const { return task_.visual; }
  VisualMap take_map() { return std::move(task_.visual); }
  // Complete after finish().
  const TwoFrameStatistics& statistics() const { return statistics_; }
  // Why frames have no pose of their own, a line each; the first hundred.
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  VisualMap& visual() { return task_.visual; }
  TwoFrameOdometry(Executor<TwoFrameTask> executor, const StereoRigd& rig, const TwoFrameOptions& options,
                   const std::array<Mat2d, 2>& noise);

  void append(const StereoFrame& frame);
  void submit();
  void settle();
  void take(std::uint32_t frame);
  void begin_chain(std::uint32_t frame);
  void learn(std::uint32_t frame);
  void make_point(std::uint32_t frame, std::uint32_t row);
  void refine_point(std::uint32_t frame, std::uint32_t row, std::uint32_t point);
  int points_of_its_own(std::uint32_t frame) const;
  Pose3d predicted(std::uint32_t frame) const;
  std::uint32_t point_of(std::int64_t track) const;
  void warn(std::uint32_t frame, const std::string& what);

  Executor<TwoFrameTask> executor_;
  TwoFrameOptions options_;
  std::array<Mat2d, 2> noise_;
  TwoFrameTask::Map task_;
  // Of the chain that is being followed; forgotten when another begins.
  std::unordered_map<std::int64_t, std::uint32_t> points_;  // by track
  std::uint32_t last_ = kNoRow, before_last_ = kNoRow;      // anchored frames
  std::uint32_t pending_ = kNoRow;                          // frame that a job is about
  std::string refusal_;
  TwoFrameStatistics statistics_;
  std::vector<std::string> warnings_;
};

}  // namespace oriel
