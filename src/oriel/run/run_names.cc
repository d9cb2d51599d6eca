#include "oriel/run/run_names.h"

#include "oriel/run/two_frame_task.h"
#include "oriel/run/window_solver.h"
#include "oriel/run/words.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

template <class T>
struct Filler {
  NameTable<T> table;
  Filler& operator()(const char* name, T value) {
    add_shipped(table, name, std::move(value));
    return *this;
  }
};

}  // namespace

NameTable<NamedLoss> shipped_losses() {
  Filler<NamedLoss> add{NameTable<NamedLoss>("loss")};
  add("huber", {Huber(1.0), "Squares up to SCALE, then the length."});
  add("cauchy", {Cauchy(1.0), "Grows as a logarithm."});
  add("geman-mcclure", {GemanMcClure(1.0), "Levels off at SCALE^2."});
  add("tukey", {Tukey(1.0), "Flat beyond SCALE, without a kink."});
  add("truncated", {TruncatedSquares(1.0), "Squares up to SCALE, then flat."});
  add("barron", {Barron(1.0, 0.0), "Of shape ALPHA: 2 squares, 1 pseudo-Huber, 0 Cauchy, -inf Welsch.", true});
  return add.table;
}

NameTable<NamedEngine> shipped_engines() {
  Filler<NamedEngine> add{NameTable<NamedEngine>("engine")};
  add("native", {[](Graph& graph) -> std::unique_ptr<Engine> { return std::make_unique<NativeEngine>(graph); },
                 "The library's own."});
  add("ceres", {nullptr, "Ceres Solver; oriel::ceres has its maker."});
  return add.table;
}

NameTable<ExecutorKind> shipped_executors() {
  Filler<ExecutorKind> add{NameTable<ExecutorKind>("executor")};
  add("inline", ExecutorKind::in_place)("thread", ExecutorKind::thread)("process", ExecutorKind::process);
  return add.table;
}

Result<ExecutorKind> executor_kind(std::string_view word) { return shipped_executors().find(word); }
std::string name_of(ExecutorKind kind) {
  const NameTable<ExecutorKind> all = shipped_executors();
  for (const auto& [name, k] : all.items())
    if (k == kind) return name;
  return {};
}

NameTable<LandmarkModel> landmark_models() {
  Filler<LandmarkModel> add{NameTable<LandmarkModel>("landmark")};
  add("by-cameras", LandmarkModel::by_cameras)("inverse-depth", LandmarkModel::inverse_depth);
  add("point", LandmarkModel::point);
  return add.table;
}
NameTable<MatchResidual> match_residuals() {
  Filler<MatchResidual> add{NameTable<MatchResidual>("residual")};
  add("points", MatchResidual::points)("pixel", MatchResidual::pixel);
  add("disparity", MatchResidual::disparity)("stereo", MatchResidual::stereo);
  return add.table;
}
NameTable<MatchCoordinates> match_coordinates() {
  Filler<MatchCoordinates> add{NameTable<MatchCoordinates>("coordinates")};
  add("previous", MatchCoordinates::previous)("world", MatchCoordinates::world);
  return add.table;
}
NameTable<MatchSource> match_sources() {
  Filler<MatchSource> add{NameTable<MatchSource>("source")};
  add("previous", MatchSource::previous)("map", MatchSource::map);
  return add.table;
}

NameTable<NamedTask> shipped_tasks() {
  Filler<NamedTask> add{NameTable<NamedTask>("task")};
  add("inertial_odometry", {"Visual-inertial odometry over a sliding window.", &WindowSolver::kTask});
  add("sliding_window", {"A sliding window put together of parts.", &WindowSolver::kTask});
  add("two_frame", {"Stereo odometry, one frame against another.", &kTaskOps<TwoFrameTask>});
  return add.table;
}

}  // namespace oriel
