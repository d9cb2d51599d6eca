// oriel solve FILE...
#include <CLI/App.hpp>
#include <cstdio>
#include <memory>
#include <vector>

#include "apps/arguments.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "apps/engine_choice.h"
#include "apps/solve_files.h"
#include "oriel/io/loss_text.h"
#include "oriel/io/text.h"

namespace oriel::apps {
namespace {

// As they stand on the command line.
struct SolveArguments {
  std::vector<std::string> files;
  std::string method = "lm", linear_solver = "auto", loss = "none", init = "auto", rotation_error = "quaternion",
              engine = "native", loss_on, information = "refuse", isam_noise = "information", out, svg, json;
  int iterations = 100, threads = 1;
  std::vector<std::string> covariance;
  bool graduated = false, joint = false, verbose = false;
  double deadline_ms = 0;
};

ProblemOptions problem_options(const SolveArguments& a) {
  ProblemOptions options;
  if (a.rotation_error == "log") options.rotation_error = RotationError::log;
  options.start = start_choice(a.init);
  // Odometry is seldom wrong, and a graph without it falls to pieces: graduated, it is trusted.
  if (a.loss_on == "loops") options.loss_on = LossOn::loops;
  if (a.loss_on.empty() && a.graduated) options.loss_on = LossOn::loops_if_any;
  options.reading.project_information = a.information == "project";
  if (a.isam_noise == "root") options.reading.isam_noise = IsamNoise::root;
  if (a.isam_noise == "covariance") options.reading.isam_noise = IsamNoise::covariance;
  options.loss = *parse_loss(a.loss);  // checked with the other arguments
  options.graduated = a.graduated;
  return options;
}

SolveOptions solve_options(const SolveArguments& a) {
  SolveOptions options;
  if (a.method == "gn") options.method = Method::gauss_newton;
  if (a.method == "dogleg") options.method = Method::dogleg;
  if (a.linear_solver == "direct") options.linear_solver = LinearSolver::direct;
  if (a.linear_solver == "cg") options.linear_solver = LinearSolver::conjugate_gradient;
  options.max_iterations = a.iterations;
  options.threads = a.threads;
  options.deadline = Duration::from_seconds(a.deadline_ms * 1e-3);
  return options;
}

Result<void> check_loss(const SolveArguments& a) {
  const LossKind kind = parse_loss(a.loss)->kind;
  if (a.graduated && kind != LossKind::none && kind != LossKind::truncated && kind != LossKind::geman_mcclure)
    return Error{ErrorCode::bad_input,
                 "--gnc: expected --loss truncated:SCALE or geman-mcclure:SCALE, found " + a.loss};
  if (a.loss_on == "loops" && kind == LossKind::none && !a.graduated)
    return Error{ErrorCode::bad_input, "--loss-on loops: expected --loss NAME:SCALE or --gnc beside it"};
  return {};
}

Result<void> check_targets(const SolveArguments& a) {
  if (!a.out.empty() && a.files.size() > 1)
    return Error{ErrorCode::bad_input, "--out: expected one FILE, found " + std::to_string(a.files.size())};
  if (a.out == "-") return Error{ErrorCode::bad_input, "--out: expected a file, found '-'"};
  if (!a.svg.empty() && a.files.size() > 1)
    return Error{ErrorCode::bad_input, "--svg: expected one FILE, found " + std::to_string(a.files.size())};
  if (auto ok = check_target(a.out); !ok) return ok;
  if (auto ok = check_target(a.svg); !ok) return ok;
  return check_target(a.json);
}

// All files are read before the first is solved: a bad one among them ends the command with nothing done.
Result<std::vector<BatchProblem>> load_all(const SolveArguments& a) {
  std::vector<BatchProblem> problems;
  for (const std::string& path : a.files) {
    Result<BatchProblem> problem = load_problem(path, problem_options(a));
    if (!problem) return problem.error();
    if (auto ids = find_variables(*problem, {a.covariance, a.joint}); !ids) return ids.error();
    problems.push_back(std::move(*problem));
  }
  return problems;
}

Result<int> solve_all(const SolveArguments& a) {
  if (auto ok = check_loss(a); !ok) return ok.error();
  if (auto ok = check_targets(a); !ok) return ok.error();
  Result<std::vector<BatchProblem>> problems = load_all(a);
  if (!problems) return problems.error();
  std::vector<SolvedFile> solved;
  int exit_code = kSolved;
  for (BatchProblem& problem : *problems) {
    Result<SolvedFile> file =
        solve_problem(problem, {solve_options(a), {a.out, a.svg}, a.graduated, {a.covariance, a.joint}, a.engine});
    if (!file) return file.error();
    if (!file->converged()) exit_code = kNotConverged;
    if (a.json != "-") std::fputs(solve_text(*file, a.verbose).c_str(), stdout);
    solved.push_back(std::move(*file));
    problem = BatchProblem{};  // its memory is not the next one's
  }
  if (!a.json.empty())
    if (auto ok = write_output(a.json, solve_json(solved)); !ok) return ok.error();
  return exit_code;
}

int run(const SolveArguments& a) {
  if (!has_engine(a.engine)) return refuse(become_one_with(a.engine));
  const Result<int> exit_code = solve_all(a);
  return exit_code ? *exit_code : refuse(exit_code.error());
}

std::string fault_of_loss(const std::string& text) {
  const Result<Loss> loss = parse_loss(text);
  return loss ? "" : loss.error().message;
}

}  // namespace

void add_solve_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<SolveArguments>();
  CLI::App* command = app.add_subcommand("solve", "Solves pose graphs (g2o) and bundle adjustments (BAL)");
  command->add_option("FILE", a->files, "Problem files, g2o or BAL by their content")->required();
  command->add_option("--method", a->method, "Levenberg-Marquardt, Powell's dogleg or Gauss-Newton")
      ->check(one_of({"lm", "dogleg", "gn"}))
      ->capture_default_str();
  add_engine_option(*command, a->engine);
  command->add_option("--linear-solver", a->linear_solver, "Of what is left without landmarks; auto: by its size")
      ->check(one_of({"auto", "direct", "cg"}))
      ->capture_default_str();
  command
      ->add_option("--loss", a->loss,
                   "none, huber:SCALE, cauchy:SCALE, geman-mcclure:SCALE, tukey:SCALE, truncated:SCALE or "
                   "barron:SCALE:ALPHA; SCALE in whitened units")
      ->check(CLI::Validator(fault_of_loss, ""))
      ->capture_default_str();
  command->add_flag("--gnc", a->graduated,
                    "Graduated non-convexity: the loss, truncated:SCALE or geman-mcclure:SCALE, begins as squares; "
                    "without --loss it is Geman-McClure's with the root of the residual's dimension as scale");
  command
      ->add_option("--loss-on", a->loss_on,
                   "Edges that have the loss; loops: of ids that are not neighbours. Default: all, with --gnc loops")
      ->check(one_of({"all", "loops"}));
  add_start_option(*command, a->init);
  command->add_option("--iterations", a->iterations, "Most steps, rejected ones counted")
      ->check(whole_number(0, 1'000'000))
      ->capture_default_str();
  command->add_option("--threads", a->threads, "The result has the same bits for any number")
      ->check(whole_number(1, 256))
      ->capture_default_str();
  command->add_option("--deadline", a->deadline_ms, "Of each solve [ms]; the best values so far are kept")
      ->check(number(1e-3, 1e9));
  command->add_option("--rotation-error", a->rotation_error, "Of 3D edges: g2o's own, or the rotation vector")
      ->check(one_of({"quaternion", "log"}))
      ->capture_default_str();
  command->add_option("--information", a->information, "Of edges where it is indefinite: refuse, or project and count")
      ->check(one_of({"refuse", "project"}))
      ->capture_default_str();
  command->add_option("--isam-noise", a->isam_noise, "What the last numbers of iSAM's lines are")
      ->check(one_of({"information", "root", "covariance"}))
      ->capture_default_str();
  command->add_option("--out", a->out, "The problem with the values found, in its own format, or as a cloud: FILE.ply");
  command->add_option("--svg", a->svg, "A picture of path, landmarks and loop edges before and after");
  command->add_option("--json", a->json, "Report, an array with one object a file; - is standard output");
  command
      ->add_option("--covariance", a->covariance,
                   "Of these variables at the solution: ids such as 17 (pose, camera) or l5 (landmark, point)")
      ->delimiter(',');
  command->add_flag("--joint", a->joint, "One covariance of all of them together");
  command->add_flag("--verbose", a->verbose, "Every iteration, and the time of every stage");
  command->callback([a, &exit_code] { exit_code = run(*a); });
}

}  // namespace oriel::apps
