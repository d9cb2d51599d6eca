#include "apps/batch_problem.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <span>
#include <utility>

#include "oriel/io/problem_format.h"
#include "oriel/io/problem_text.h"
#include "oriel/io/text.h"

namespace oriel::apps {
namespace {

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

template <class Ids>
Result<void> take(Result<Ids> added, BatchProblem& problem) {
  if (!added) return added.error();
  problem.ids = std::move(*added);
  return {};
}

// Of the size that the residual of a right measurement of so many numbers is expected to have: E[s] = dim.
Loss likely_loss(int dim) { return GemanMcClure(std::sqrt(static_cast<double>(dim))); }

Result<void> build(BatchProblem& problem, ProblemOptions options) {
  const auto* poses_and_edges = std::get_if<PoseGraphFile>(&problem.file);
  if (options.graduated && options.loss.kind == LossKind::none)
    options.loss = likely_loss(poses_and_edges == nullptr ? 2 : poses_and_edges->is_3d ? 6 : 3);
  problem.graph = std::make_unique<Graph>();
  if (const auto* bal = std::get_if<BalFile>(&problem.file)) {
    if (options.start != StartChoice::automatic && options.start != StartChoice::file)
      return Error{ErrorCode::bad_input, "expected --init file or auto: a BAL file has no odometry", problem.path};
    if (options.loss_on == LossOn::loops)
      return Error{ErrorCode::bad_input, "expected --loss-on all: a BAL file has no loops", problem.path};
    return take(add_bundle_adjustment(*problem.graph, *bal, options.loss), problem);
  }
  const auto& file = std::get<PoseGraphFile>(problem.file);
  PoseGraphOptions pose_graph{options.rotation_error, PoseStart::file, options.loss, options.loss_on != LossOn::all};
  const Result<PoseGraphStart> start = choose_start(file, pose_graph, options.start);
  if (!start) return start.error();
  problem.start = pose_graph.start = start->kind;
  if (file.is_3d) return take(add_pose_graph3(*problem.graph, file, pose_graph, start->spatial), problem);
  return take(add_pose_graph2(*problem.graph, file, pose_graph, start->planar), problem);
}

template <class Id>
std::ptrdiff_t place_of(const std::vector<Id>& ids, const VariableKey& key) {
  const auto it = std::find_if(ids.begin(), ids.end(), [&](const Id& id) { return VariableKey(id) == key; });
  return it == ids.end() ? -1 : it - ids.begin();
}

template <class Ids>
std::string pose_graph_name(const Ids& ids, const BatchProblem& problem, const VariableKey& key) {
  const auto& file = std::get<PoseGraphFile>(problem.file);
  const std::ptrdiff_t pose = place_of(ids.poses, key), landmark = place_of(ids.landmarks, key);
  if (landmark >= 0) return "landmark " + std::to_string(file.landmark_ids[landmark]);
  return pose < 0 ? "" : "pose " + std::to_string(file.ids[pose]);
}

// As the file calls it, else as the graph does.
std::string name_of(const BatchProblem& problem, const VariableKey& key) {
  std::string name;
  if (const auto* ba = std::get_if<BundleAdjustment>(&problem.ids)) {
    const std::ptrdiff_t camera = place_of(ba->cameras, key), point = place_of(ba->points, key);
    if (camera >= 0) name = "camera " + std::to_string(camera);
    if (point >= 0) name = "point " + std::to_string(point);
  } else if (const auto* planar = std::get_if<PoseGraph2>(&problem.ids)) {
    name = pose_graph_name(*planar, problem, key);
  } else {
    name = pose_graph_name(std::get<PoseGraph3>(problem.ids), problem, key);
  }
  return name.empty() ? problem.graph->describe(key) : name;
}

std::string direction_text(const BatchProblem& problem, const UndeterminedDirection& direction) {
  std::string text;
  for (const UndeterminedScalar& s : direction.scalars) {
    const VariableOps* ops = problem.graph->find_ops(s.id.type);
    const bool named = ops != nullptr && static_cast<std::size_t>(s.tangent) < ops->tangent_names.size();
    text += (text.empty() ? "" : ", ") + name_of(problem, s.id) + ": ";
    text += named ? std::string(ops->tangent_names[s.tangent]) : "tangent " + std::to_string(s.tangent);
  }
  if (direction.variables > direction.scalars.size())
    text += " (" + std::to_string(direction.variables) + " variables move together)";
  return text;
}

// The graph's values into the file's structure.
void take_values(BatchProblem& problem) {
  if (auto* bal = std::get_if<BalFile>(&problem.file)) {
    copy_values(*problem.graph, std::get<BundleAdjustment>(problem.ids), *bal);
    return;
  }
  auto& file = std::get<PoseGraphFile>(problem.file);
  if (file.is_3d)
    copy_values(*problem.graph, std::get<PoseGraph3>(problem.ids), file);
  else
    copy_values(*problem.graph, std::get<PoseGraph2>(problem.ids), file);
}

}  // namespace

std::size_t BatchProblem::poses() const {
  const auto* bal = std::get_if<BalFile>(&file);
  return bal != nullptr ? bal->cameras.size() : std::get<PoseGraphFile>(file).ids.size();
}

std::size_t BatchProblem::landmarks() const {
  const auto* bal = std::get_if<BalFile>(&file);
  return bal != nullptr ? bal->points.size() : std::get<PoseGraphFile>(file).landmark_ids.size();
}

const char* BatchProblem::format() const {
  const auto* poses_and_edges = std::get_if<PoseGraphFile>(&file);
  if (poses_and_edges == nullptr) return "bal";
  const PoseGraphSpelling spelling = poses_and_edges->spelling;
  return spelling == PoseGraphSpelling::g2o ? "g2o" : spelling == PoseGraphSpelling::toro ? "toro" : "isam";
}

Result<ProblemFile> read_problem(const std::string& path, const PoseGraphReading& reading) {
  const Result<ProblemText> text = read_problem_text(path);
  if (!text) return text.error();
  const Result<ProblemFormat> format = detect_format(text->view(), path);
  if (!format) return format.error();
  if (*format == ProblemFormat::bal) {
    Result<BalFile> file = parse_bal(text->view(), path);
    if (!file) return file.error();
    return ProblemFile(std::move(*file));
  }
  Result<PoseGraphFile> file = parse_g2o(text->view(), path, reading);
  if (file) return ProblemFile(std::move(*file));
  Error error = file.error();
  if (error.code == ErrorCode::indefinite) error.message += " (--information project repairs it)";
  return error;
}

Result<BatchProblem> load_problem(const std::string& path, const ProblemOptions& options) {
  BatchProblem problem;
  problem.path = path;
  const double began = seconds_now();
  auto file = read_problem(path, options.reading);
  if (!file) return file.error();
  problem.file = std::move(*file);
  const double read = seconds_now();
  if (auto ok = build(problem, options); !ok) return ok.error();
  problem.read_seconds = read - began;
  problem.setup_seconds = seconds_now() - read;
  return problem;
}

Result<void> check_form(const BatchProblem& problem, const std::string& path) {
  const bool is_bal = std::holds_alternative<BalFile>(problem.file);
  const std::string extension = std::filesystem::path(path).extension();
  if (extension == (is_bal ? ".g2o" : ".bal"))
    return Error{ErrorCode::bad_input,
                 is_bal ? "expected a file for a bundle adjustment (BAL or .ply), found g2o's extension"
                        : "expected a file for a pose graph (.g2o or .ply), found BAL's extension",
                 path};
  return {};
}

Result<void> write_problem(BatchProblem& problem, const std::string& path) {
  if (auto ok = check_form(problem, path); !ok) return ok;
  take_values(problem);
  if (std::filesystem::path(path).extension() == ".ply") return write_text_file(path, format_ply(draw(problem)));
  if (const auto* bal = std::get_if<BalFile>(&problem.file)) return write_bal(path, *bal);
  return write_g2o(path, std::get<PoseGraphFile>(problem.file));
}

Drawing draw(BatchProblem& problem) {
  take_values(problem);
  return std::visit([](const auto& file) { return drawing_of(file); }, problem.file);
}

std::string gauge_text(const BatchProblem& problem, const Summary& summary) {
  if (std::holds_alternative<BalFile>(problem.file))
    return "nothing held: rotation, translation and scale of the whole are free";
  const auto& file = std::get<PoseGraphFile>(problem.file);
  std::string text = "first pose held (id " + std::to_string(file.ids.front()) + ")";
  if (file.fixed.size() == 1) text = "held by FIX (id " + std::to_string(file.ids[file.fixed[0]]) + ")";
  if (file.fixed.size() > 1) text = "held by FIX (" + std::to_string(file.fixed.size()) + " poses)";
  if (!file.fixed_landmarks.empty())
    text = (file.fixed.empty() ? "held by FIX (" : text + ", (") + std::to_string(file.fixed_landmarks.size()) +
           " landmarks)";
  for (const UndeterminedDirection& d : summary.gauge) text += "; free in common: " + direction_text(problem, d);
  return text;
}

std::vector<std::string> undetermined_texts(const BatchProblem& problem, const Summary& summary) {
  std::vector<std::string> texts;
  for (const UndeterminedDirection& d : summary.undetermined) texts.push_back(direction_text(problem, d));
  return texts;
}

}  // namespace oriel::apps
