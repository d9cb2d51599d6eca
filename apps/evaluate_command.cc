// oriel evaluate EST GT
#include <CLI/App.hpp>
#include <memory>

#include "apps/arguments.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "oriel/evaluate/report.h"

namespace oriel::apps {
namespace {

struct EvaluateArguments {
  std::string estimate, truth, align = "se3", json;
  double max_dt_s = 0.01;
};

Result<void> evaluate_and_report(const EvaluateArguments& a) {
  if (auto ok = check_target(a.json); !ok) return ok;
  EvaluationOptions options;
  options.alignment = *parse_alignment(a.align);  // one of its names: checked with the other arguments
  options.max_dt = Duration::from_seconds(a.max_dt_s);
  const Result<EvaluationReport> report = evaluate_files(a.estimate, a.truth, options);
  if (!report) return report.error();
  if (!a.json.empty())
    if (auto ok = write_output(a.json, to_json(*report) + "\n"); !ok) return ok;
  return a.json == "-" ? Result<void>() : write_output("-", to_text(*report));
}

int run(const EvaluateArguments& a) {
  const Result<void> done = evaluate_and_report(a);
  return done ? kSolved : refuse(done.error());
}

}  // namespace

void add_evaluate_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<EvaluateArguments>();
  CLI::App* command = app.add_subcommand("evaluate", "Error of an estimated trajectory against the true one");
  command->add_option("EST", a->estimate, "Estimate, TUM or KITTI")->required();
  command->add_option("GT", a->truth, "Truth, of the same format")->required();
  command->add_option("--align", a->align, "What the estimate may be moved by")
      ->check(one_of({"se3", "sim3", "yaw", "none"}))
      ->capture_default_str();
  command->add_option("--max-dt", a->max_dt_s, "Largest difference of the stamps of a pair [s]")
      ->check(number(0, 1e6))
      ->capture_default_str();
  command->add_option("--json", a->json, "Report as one object; - is standard output");
  command->callback([a, &exit_code] { exit_code = run(*a); });
}

}  // namespace oriel::apps
