#include "oriel/run/two_frame_odometry.h"

#include <utility>

#include "oriel/residual/matched_point.h"
#include "oriel/window/stereo_point.h"

namespace oriel {
namespace {

constexpr std::size_t kMostWarnings = 100;

Mat2d covariance_of(const Vec2d& sigma, double otherwise) {
  Mat2d V = Mat2d::zero();
  for (int i = 0; i < 2; ++i) {
    const double s = sigma[i] > 0.0 ? sigma[i] : otherwise;
    V(i, i) = s * s;
  }
  return V;
}

// r of a sighting of p (in the body of `a`), its Jacobian by p, and V with what is not known of T_a_b.
template <int D>
bool update(const StereoRigd& rig, const Pose3d& T_a_b, const Mat6d& covariance, const Vec<double, D>& seen,
            Mat<double, D, D> V, Vec3d& p, Mat3d& point_covariance) {
  Vec<double, D> r;
  Mat<double, D, 6> J_a, J_b;
  if (!MatchedPoint<double, D>{p, seen}.evaluate(Pose3d{}, T_a_b, rig, r, &J_a, &J_b)) return false;
  V += J_b * covariance * J_b.transposed();
  return fuse_sighting<D>(r, J_a.template block<D, 3>(0, 3), V, p, point_covariance);
}

}  // namespace

TwoFrameOdometry::TwoFrameOdometry(Executor<TwoFrameTask> executor, const StereoRigd& rig,
                                   const TwoFrameOptions& options, const std::array<Mat2d, 2>& noise)
    : executor_(std::move(executor)), options_(options), noise_(noise) {
  visual().rigs.push_back(rig);
}

Result<TwoFrameOdometry> TwoFrameOdometry::start(ExecutorKind kind, const StereoRigd& rig,
                                                 const TwoFrameOptions& options, const ExecutorOptions& executor,
                                                 const std::array<Vec2d, 2>& pixel_sigma) {
  auto started = Executor<TwoFrameTask>::start(kind, {options, rig}, executor);
  if (!started) return started.error();
  const std::array<Mat2d, 2> noise = {covariance_of(pixel_sigma[0], options.pixel_sigma),
                                      covariance_of(pixel_sigma[1], options.pixel_sigma)};
  return TwoFrameOdometry(std::move(*started), rig, options, noise);
}

Result<void> TwoFrameOdometry::add(const StereoFrame& frame) {
  if (visual().frames.size() > 0 && frame.time <= visual().frames.time.back())
    return Error{ErrorCode::bad_input, "expected a later stamp than that of the frame before"};
  append(frame);
  settle();
  submit();
  return {};
}

// The frame's rows. Points of its own need no pose: they are made while the task of the frame before runs.
void TwoFrameOdometry::append(const StereoFrame& frame) {
  const StereoRigd& rig = visual().rigs[0];
  visual().add_frame(frame.time, Pose3d{}, 0);
  for (const FeatureObservation& f : frame.features) {
    VisualMap::Observation o{f.track, f.has_right, f.pixel0, f.pixel1, noise_[0], noise_[1]};
    if (f.has_right)
      if (const auto p = stereo_point(rig, {f.pixel0, f.pixel1, noise_[0], noise_[1]}, {options_.greatest_depth_share}))
        o.p_camera = p->p_camera, o.covariance = p->covariance;
    visual().add_observation(o);
  }
}

void TwoFrameOdometry::submit() {
  const std::uint32_t b = visual().frames.size() - 1;
  pending_ = b;
  refusal_.clear();
  visual().frames.T_world_body[b] = predicted(b);
  if (last_ == kNoRow) return;
  std::vector<std::uint32_t> points;
  for (std::uint32_t k = 0; k < visual().frames.count[b]; ++k)
    points.push_back(point_of(visual().observations.track[visual().frames.first[b] + k]));
  const Pose3d T_a_b = visual().frames.T_world_body[last_].inverse() * visual().frames.T_world_body[b];
  const JobReport report = executor_.submit(TwoFrameTask().collect(visual(), last_, b, T_a_b, options_, points));
  if (report.status != JobStatus::accepted) refusal_ = report.message;
}

// What became of the frame whose task was handed over.
void TwoFrameOdometry::settle() {
  if (pending_ == kNoRow) return;
  const std::uint32_t k = std::exchange(pending_, kNoRow);
  FrameStatus& status = visual().frames.status[k];
  if (last_ == kNoRow) {
    status = FrameStatus::few;
  } else {
    const JobReport report = executor_.write_back(task_);
    statistics_.restarts += report.restarted ? 1 : 0;
    if (report.status != JobStatus::done) status = FrameStatus::failed;
    if (status != FrameStatus::solved)
      warn(k, report.status == JobStatus::done ? task_.last.reason : refusal_.empty() ? report.message : refusal_);
  }
  if (status == FrameStatus::solved)
    take(k);
  else if (status != FrameStatus::failed && points_of_its_own(k) >= options_.least_observations)
    begin_chain(k);
}

void TwoFrameOdometry::take(std::uint32_t k) {
  statistics_.matches += task_.last.figures.matches;
  statistics_.inliers += task_.last.figures.inliers;
  statistics_.iterations += task_.last.figures.iterations;
  statistics_.final_cost += task_.last.figures.final_cost;
  before_last_ = last_;
  last_ = k;
  learn(k);
}

void TwoFrameOdometry::begin_chain(std::uint32_t k) {
  visual().frames.status[k] = last_ == kNoRow ? FrameStatus::origin : FrameStatus::held;
  points_.clear();
  before_last_ = last_;
  last_ = k;
  learn(k);
}

// Points of the frame join the map; those that are there are told what it saw of them.
void TwoFrameOdometry::learn(std::uint32_t k) {
  VisualMap& m = visual();
  for (std::uint32_t row = m.frames.first[k]; row < m.observations.size() && m.observations.frame[row] == k; ++row) {
    const std::uint32_t point = point_of(m.observations.track[row]);
    const bool agrees = m.observations.inlier[row] != 0;
    if (point != kNoRow && agrees) {
      m.observations.point[row] = point;
      refine_point(k, row, point);
    } else if (point == kNoRow || m.points.sightings[point] == 1) {
      make_point(k, row);  // of two words against each other the newer one stands
    }
  }
}

void TwoFrameOdometry::make_point(std::uint32_t k, std::uint32_t row) {
  VisualMap& m = visual();
  const MapObservations& o = m.observations;
  if (!o.has_point(row)) return;
  const StereoRigd& rig = m.rigs[0];
  const std::uint32_t point =
      m.add_point(o.track[row], in_body(rig, o.p_camera[row]), in_body(rig, o.covariance[row]), k);
  m.observations.point[row] = point;
  m.observations.inlier[row] = 1;
  points_[o.track[row]] = point;
}

void TwoFrameOdometry::refine_point(std::uint32_t k, std::uint32_t row, std::uint32_t point) {
  VisualMap& m = visual();
  const MapObservations& o = m.observations;
  const StereoRigd& rig = m.rigs[0];
  Vec3d& p = m.points.p[point];
  Mat3d& covariance = m.points.covariance[point];
  std::uint32_t& frame = m.points.frame[point];
  if (options_.source == MatchSource::previous) {
    if (!o.has_point(row)) return;
    p = in_body(rig, o.p_camera[row]);
    covariance = in_body(rig, o.covariance[row]);
    frame = k;
    m.points.sightings[point] = 1;
    return;
  }
  const Pose3d T_a_b = m.frames.T_world_body[frame].inverse() * m.frames.T_world_body[k];
  const Vec2d &left = o.pixel0[row], &right = o.pixel1[row];
  bool done = false;
  if (o.has_right[row] != 0) {
    Mat<double, 4, 4> V = Mat<double, 4, 4>::zero();
    V.set_block(0, 0, o.covariance0[row]);
    V.set_block(2, 2, o.covariance1[row]);
    const Vec4d seen = {{left[0], left[1], right[0], right[1]}};
    done = update<4>(rig, T_a_b, m.frames.covariance[k], seen, V, p, covariance);
  } else {
    done = update<2>(rig, T_a_b, m.frames.covariance[k], left, o.covariance0[row], p, covariance);
  }
  m.points.sightings[point] += done ? 1 : 0;
}

int TwoFrameOdometry::points_of_its_own(std::uint32_t k) const {
  const VisualMap& m = map();
  int n = 0;
  for (std::uint32_t i = 0; i < m.frames.count[k]; ++i) n += m.observations.has_point(m.frames.first[k] + i) ? 1 : 0;
  return n;
}

// The motion between the two last frames with a pose is held.
Pose3d TwoFrameOdometry::predicted(std::uint32_t k) const {
  const MapFrames& f = map().frames;
  if (last_ == kNoRow) return {};
  if (before_last_ == kNoRow) return f.T_world_body[last_];
  return interpolated(f.time[k], f.time[before_last_], f.T_world_body[before_last_], f.time[last_],
                      f.T_world_body[last_]);
}

std::uint32_t TwoFrameOdometry::point_of(std::int64_t track) const {
  const auto at = points_.find(track);
  if (at == points_.end()) return kNoRow;
  const bool current = options_.source == MatchSource::map || map().points.frame[at->second] == last_;
  return current ? at->second : kNoRow;
}

void TwoFrameOdometry::warn(std::uint32_t k, const std::string& what) {
  if (warnings_.size() < kMostWarnings) warnings_.push_back("frame " + std::to_string(k) + ": " + what);
}

void TwoFrameOdometry::finish() {
  settle();
  (void)interpolate_poses(visual().frames);
  statistics_.frames = {};
  for (const FrameStatus status : visual().frames.status) ++statistics_.frames[static_cast<std::size_t>(status)];
}

}  // namespace oriel
