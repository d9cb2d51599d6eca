#include "oriel/evaluate/associate.h"

#include <algorithm>
#include <string>
#include <utility>

namespace oriel {
namespace {

// Stamps may be anywhere in the range of 64 bits: their distance needs all of an unsigned one.
std::uint64_t distance(Time a, Time b) {
  const auto x = static_cast<std::uint64_t>(a.ns), y = static_cast<std::uint64_t>(b.ns);
  return a < b ? y - x : x - y;
}

std::size_t nearest(const std::vector<TumPose>& poses, Time time) {
  const auto later =
      std::lower_bound(poses.begin(), poses.end(), time, [](const TumPose& pose, Time t) { return pose.time < t; });
  const auto i = static_cast<std::size_t>(later - poses.begin());
  if (i == 0) return 0;
  if (i == poses.size()) return i - 1;
  return distance(poses[i - 1].time, time) <= distance(poses[i].time, time) ? i - 1 : i;
}

}  // namespace

std::vector<PosePair> nearest_stamps(const std::vector<TumPose>& estimate, const std::vector<TumPose>& truth,
                                     Duration max_dt) {
  const bool estimate_is_shorter = estimate.size() <= truth.size();
  const std::vector<TumPose>& fewer = estimate_is_shorter ? estimate : truth;
  const std::vector<TumPose>& more = estimate_is_shorter ? truth : estimate;
  const std::uint64_t most = max_dt.ns < 0 ? 0 : static_cast<std::uint64_t>(max_dt.ns);
  std::vector<std::pair<std::size_t, std::size_t>> found;  // (fewer, more), ascending in both
  for (std::size_t i = 0; i < fewer.size() && !more.empty(); ++i) {
    const std::size_t j = nearest(more, fewer[i].time);
    const std::uint64_t dt = distance(more[j].time, fewer[i].time);
    if (dt > most) continue;
    if (found.empty() || found.back().second != j)
      found.emplace_back(i, j);
    else if (dt < distance(more[j].time, fewer[found.back().first].time))
      found.back().first = i;
  }
  std::vector<PosePair> pairs;
  pairs.reserve(found.size());
  for (const auto& [i, j] : found) pairs.push_back(estimate_is_shorter ? PosePair{i, j} : PosePair{j, i});
  return pairs;
}

std::vector<TumPose> sorted_by_stamp(std::vector<TumPose> poses) {
  std::stable_sort(poses.begin(), poses.end(), [](const TumPose& a, const TumPose& b) { return a.time < b.time; });
  const auto end =
      std::unique(poses.begin(), poses.end(), [](const TumPose& a, const TumPose& b) { return a.time == b.time; });
  poses.erase(end, poses.end());
  return poses;
}

Result<std::vector<PosePair>> associate(TrajectoryFile& estimate, TrajectoryFile& truth, Duration max_dt) {
  if (estimate.stamped != truth.stamped)
    return Error{ErrorCode::bad_input,
                 std::string("expected ") + (truth.stamped ? "stamps" : "KITTI matrices") + " as in " + truth.file_name,
                 estimate.file_name};
  if (!truth.stamped && estimate.poses.size() != truth.poses.size())
    return Error{ErrorCode::size_mismatch,
                 "expected " + std::to_string(truth.poses.size()) + " poses as in " + truth.file_name +
                     ", as neither has stamps; found " + std::to_string(estimate.poses.size()),
                 estimate.file_name};
  estimate.poses = sorted_by_stamp(std::move(estimate.poses));
  truth.poses = sorted_by_stamp(std::move(truth.poses));
  std::vector<PosePair> pairs = nearest_stamps(estimate.poses, truth.poses, truth.stamped ? max_dt : Duration{0});
  if (pairs.empty())
    return Error{
        ErrorCode::bad_input,
        "expected stamps within " + format_seconds({max_dt.ns}) + " s of those in " + truth.file_name + ", found none",
        estimate.file_name};
  return pairs;
}

}  // namespace oriel
