#include "benchmarks/support/oriel_window.h"

#include <algorithm>

#include "benchmarks/support/clocks.h"

namespace oriel::benchmark {

OrielWindow::OrielWindow(const WindowData& data, const WindowOptions& options) : data_(data), options_(options) {
  solve_options_.max_iterations = options.iterations;
  solve_options_.initial_lambda = options.initial_lambda;
  solve_options_.first_estimates = options.first_estimates;
  solve_options_.function_tolerance = solve_options_.gradient_tolerance = solve_options_.step_tolerance = 0.0;
  solve_options_.trace = false;
  if (options.cpu_stages) solve_options_.clock = [] { return cpu_seconds(); };
  fold_options_.landmarks = LandmarkPolicy::close;
  fold_options_.first_estimates = options.first_estimates;
  landmarks_.resize(data.stream.tracks.size());
  states_.reserve(static_cast<std::size_t>(options.window) + 1);
}

SlideReport OrielWindow::slide() {
  SlideReport report;
  const double cpu0 = cpu_seconds(), t0 = wall_seconds();
  edit_.clear();
  if (next_ == 0)
    add_first_state();
  else
    add_state(next_, data_.stream.keyframes[next_].motion.motion, data_.imu_noise[next_]);
  for (const View& view : data_.views[next_]) add_view(view);
  apply(edit_);
  const double t1 = wall_seconds();
  summary_ = engine_.solve(solve_options_);
  const double t2 = wall_seconds();
  ++next_;
  if (std::ssize(states_) == options_.window) fold_oldest();
  const double t3 = wall_seconds();
  report.cpu = cpu_seconds() - cpu0;
  report.build = t1 - t0, report.solve = t2 - t1, report.fold = t3 - t2, report.wall = t3 - t0;
  count(report);
  return report;
}

SlideReport OrielWindow::pass() {
  SlideReport report;
  const int k = next_ - 1;
  const double cpu0 = cpu_seconds(), t0 = wall_seconds();
  edit_.clear();
  add_state(next_, data_.stream.between[k].motion.motion, data_.between_noise[k]);
  for (const View& view : data_.between_views[k]) add_view(view);
  apply(edit_);
  const double t1 = wall_seconds();
  summary_ = engine_.solve(solve_options_);
  const double t2 = wall_seconds();
  remove_newest();
  const double t3 = wall_seconds();
  report.cpu = cpu_seconds() - cpu0;
  report.build = t1 - t0, report.solve = t2 - t1, report.fold = t3 - t2, report.wall = t3 - t0;
  count(report);
  return report;
}

void OrielWindow::rehearse() {
  const int window = options_.window;
  options_.window = window + std::max(3, window / 3);
  states_.reserve(static_cast<std::size_t>(options_.window) + 1);
  for (int i = 0; i < options_.window + 2; ++i) {
    (void)slide();
    (void)pass();
  }
  options_.window = window;
  clear();
}

void OrielWindow::clear() {
  edit_.clear();
  for (const auto& pool : graph_.pools())
    for (std::uint32_t d = 0; d < pool->extent(); ++d)
      if (pool->slots().is_live(d)) edit_.remove(VariableKey{pool->ops().key, pool->slots().key(d)});
  apply(edit_);
  engine_.restore({});
  states_.clear();
  for (Landmark& l : landmarks_) l = {};
  next_ = 0;
}

// With all factors on it.
void OrielWindow::remove_newest() {
  const State& newest = states_.back();
  edit_.clear();
  edit_.remove(newest.pose);
  edit_.remove(newest.v);
  edit_.remove(newest.bias);
  apply(edit_);
  states_.pop_back();
}

void OrielWindow::add_first_state() {
  rig_ = edit_.add(data_.stream.rig);
  const FirstState first = first_state(data_);
  const State s{0, edit_.add(first.T_world_body), edit_.add(first.v), edit_.add(first.bias)};
  states_.push_back(s);
  const double sigma[15] = {kStartRotation, kStartRotation, kStartRotation,  kStartPosition,  kStartPosition,
                            kStartPosition, kStartVelocity, kStartVelocity,  kStartVelocity,  kStartGyroBias,
                            kStartGyroBias, kStartGyroBias, kStartAccelBias, kStartAccelBias, kStartAccelBias};
  LinearPrior prior;
  prior.variables = {s.pose, s.v, s.bias};
  auto append = [&prior](const auto& value) {
    double numbers[sizeof(value) / sizeof(double)];
    std::memcpy(numbers, &value, sizeof(value));
    prior.estimates.insert(prior.estimates.end(), std::begin(numbers), std::end(numbers));
  };
  append(first.T_world_body), append(first.v), append(first.bias);
  prior.rows = prior.cols = 15;
  prior.d.assign(15, 0.0);
  prior.R.assign(15 * 15, 0.0);
  for (int i = 0; i < 15; ++i) prior.R[i * 16] = 1.0 / sigma[i];
  edit_.add(prior);
}

void OrielWindow::add_state(int k, const PreintegratedImud& motion, const FullNoise<15>& noise) {
  const State last = states_.back();
  const ImuBiasd bias = graph_.value(last.bias);
  const PredictedState next = predict_state(motion, graph_.value(last.pose), graph_.value(last.v), bias);
  const State s{k, edit_.add(next.T_world_body), edit_.add(next.v), edit_.add(bias)};
  states_.push_back(s);
  edit_.add(ImuResiduald{motion}, noise, last.pose, last.v, last.bias, s.pose, s.v, s.bias);
}

const OrielWindow::State& OrielWindow::state_of(int k) const { return states_[k - states_.front().keyframe]; }

void OrielWindow::add_view(const View& view) {
  const SimulatedObservation& o = *view.observation;
  const SimulatedTrack& track = data_.stream.tracks[o.track];
  const State &anchor = state_of(track.anchor), &state = state_of(view.keyframe);
  const bool at_anchor = anchor.keyframe == state.keyframe;
  Landmark& landmark = landmarks_[o.track];
  if (!landmark.exists) {
    landmark = {edit_.add(InverseDepthd{track.first_guess}), true};
  }
  const IsotropicNoise noise = Sigma(options_.pixel_sigma);
  if (at_anchor)
    edit_.add(AnchorReprojectiond{track.bearing, o.pixel1}, noise, options_.loss, landmark.id, rig_);
  else if (options_.stereo)
    edit_.add(StereoReprojectiond{track.bearing, o.pixel0, o.pixel1}, noise, options_.loss, anchor.pose, state.pose,
              landmark.id, rig_);
  else
    edit_.add(MonoReprojectiond{track.bearing, o.pixel0}, noise, options_.loss, anchor.pose, state.pose, landmark.id,
              rig_);
}

void OrielWindow::apply(GraphEdit& edit) {
  if (auto ok = graph_.apply(edit); !ok && error_.empty()) error_ = ok.error().text();
}

void OrielWindow::fold_oldest() {
  const State& oldest = states_.front();
  const VariableKey leaving[] = {oldest.pose, oldest.v, oldest.bias};
  const auto report = marginalizer_.marginalize(graph_, leaving, fold_options_, fold_edit_);
  if (!report && error_.empty()) error_ = report.error().text();
  apply(fold_edit_);
  states_.erase(states_.begin());
}

void OrielWindow::count(SlideReport& report) const {
  report.initial_cost = summary_.initial_cost;
  report.final_cost = summary_.final_cost;
  report.iterations = summary_.iterations;
  report.stages = summary_.seconds;
  report.factor_flops = summary_.factor_flops, report.schur_flops = summary_.schur_flops;
  report.landmarks = summary_.landmark_dim;
  report.reprojections = static_cast<int>(summary_.factors);
}

}  // namespace oriel::benchmark
