// What a window of the linear world holds, in the words of its model.
#pragma once
#include "window_model.h"

namespace oriel::linear_world {

inline WindowModel::Values values_of(const LinearWindow& w, const std::set<int>& landmarks) {
  const Graph& graph = w.window.graph();
  WindowModel::Values all;
  for (const State& s : w.window.states().timeline(w.positions)) {
    const Vec2d& v = graph.value(VariableId<Position>{s.variables[0].key}).v;
    all[{What::position, s.time.ns}] = Eigen::Vector2d(v[0], v[1]);
  }
  for (const State& s : w.window.states().timeline(w.levels)) {
    const Vec3d& v = graph.value(LevelProvider::level(s)).v;
    all[{What::level, s.time.ns}] = Eigen::Vector3d(v[0], v[1], v[2]);
    all[{What::offset, s.time.ns}] = Eigen::VectorXd::Constant(1, graph.value(LevelProvider::offset(s)).v[0]);
  }
  for (const int l : landmarks)
    if (const Point2d* p = w.builder->landmarks[l] ? graph.find(*w.builder->landmarks[l]) : nullptr)
      all[{What::landmark, l}] = Eigen::Vector2d(p->p[0], p->p[1]);
  return all;
}

// The state or landmark that a variable of the window stands for.
inline Unknown meaning(const LinearWindow& w, const std::set<int>& landmarks, VariableKey id) {
  for (const State& s : w.window.states().timeline(w.positions))
    if (s.variables[0] == id) return {What::position, s.time.ns};
  for (const State& s : w.window.states().timeline(w.levels)) {
    if (s.variables[0] == id) return {What::level, s.time.ns};
    if (s.variables[1] == id) return {What::offset, s.time.ns};
  }
  for (const int l : landmarks)
    if (w.builder->landmarks[l] && VariableKey{*w.builder->landmarks[l]} == id) return {What::landmark, l};
  ADD_FAILURE() << "a prior knows " << w.window.graph().describe(id) << ", which is nothing of the model";
  return {};
}

// From d + R (x - x̂) to R x - d'.
inline std::vector<WindowModel::Prior> priors_of(const LinearWindow& w, const std::set<int>& landmarks) {
  const Graph& graph = w.window.graph();
  std::vector<WindowModel::Prior> all;
  for (std::uint32_t row = 0; row < graph.priors().extent(); ++row) {
    if (!graph.priors().slots().is_live(row)) continue;
    const LinearPriorView p = graph.priors().numbers(row);
    const double* x = graph.priors().estimates(row);
    WindowModel::Prior& prior = all.emplace_back();
    prior.R = Eigen::Map<const Eigen::MatrixXd>(p.R, p.rows, p.cols);
    Eigen::VectorXd estimates(p.cols);
    int column = 0;
    for (const VariableRef& ref : graph.priors().variables(row)) {
      const VariablePool& pool = *graph.pools()[ref.pool];
      const int dim = pool.ops().dim;
      prior.of.push_back(meaning(w, landmarks, {pool.ops().key, pool.slots().key_of_slot(ref.slot)}));
      estimates.segment(column, dim) = Eigen::Map<const Eigen::VectorXd>(x, dim);
      column += dim, x += estimate_doubles(pool.ops());
    }
    prior.d = prior.R * estimates - Eigen::Map<const Eigen::VectorXd>(p.d, p.rows);
  }
  return all;
}

}  // namespace oriel::linear_world
