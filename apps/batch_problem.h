// A problem file as `oriel solve` has it: read, turned into a graph, solved, and written back.
#pragma once
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "apps/pose_graph_start.h"
#include "oriel/io/drawing.h"
#include "oriel/io/problem.h"
#include "oriel/solve/summary.h"

namespace oriel::apps {

using ProblemFile = std::variant<PoseGraphFile, BalFile>;

// Which edges have the loss. loops_if_any: of a pose graph the loops, of a bundle adjustment, which has none, all.
enum class LossOn { all, loops, loops_if_any };

struct ProblemOptions {
  RotationError rotation_error = RotationError::quaternion;
  Loss loss;
  StartChoice start = StartChoice::automatic;
  LossOn loss_on = LossOn::all;
  bool graduated = false;  // without a loss: one to be graduated, by the size of the residuals
  PoseGraphReading reading;
};

struct BatchProblem {
  std::string path;
  ProblemFile file;
  std::variant<PoseGraph2, PoseGraph3, BundleAdjustment> ids;
  std::unique_ptr<Graph> graph;  // engines point to it, so that it must not move
  PoseStart start = PoseStart::file;
  double read_seconds = 0.0;   // file → memory
  double setup_seconds = 0.0;  // memory → graph and start

  std::size_t poses() const;      // or cameras
  std::size_t landmarks() const;  // points
  std::size_t factors() const { return graph->factor_count(); }
  const char* format() const;  // bal, g2o, toro or isam
};

// Format by content. Errors name the file, and the line where there is one.
Result<ProblemFile> read_problem(const std::string& path, const PoseGraphReading& reading);

// Format by content. Errors name the file, and the line where there is one.
Result<BatchProblem> load_problem(const std::string& path, const ProblemOptions& options);

// The graph's values, in the form that the extension of the path names: .ply, or else the problem's own, g2o or BAL. A
// form that cannot hold the problem (.g2o for a bundle adjustment, .bal for a pose graph) is refused by both.
Result<void> check_form(const BatchProblem& problem, const std::string& path);
Result<void> write_problem(BatchProblem& problem, const std::string& path);

// The graph's values, to be drawn.
Drawing draw(BatchProblem& problem);

// What fixes the whole in space, e.g. "first pose held (id 0)".
std::string gauge_text(const BatchProblem& problem, const Summary& summary);

// What nothing determines, by the names of the file: "pose 17: translation x [m]". One text a direction.
std::vector<std::string> undetermined_texts(const BatchProblem& problem, const Summary& summary);

}  // namespace oriel::apps
