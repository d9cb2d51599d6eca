// oriel replay JOURNAL [--verify] [--threads N] [--drop-caches]
#include <CLI/App.hpp>
#include <cstdio>
#include <memory>

#include "apps/command.h"
#include "apps/commands.h"
#include "oriel/io/replay.h"
#include "oriel/run/registry.h"

namespace oriel::apps {
namespace {

struct ReplayArguments {
  std::string journal;
  ReplayOptions options;
};

void print(const ReplayArguments& a, const ReplayReport& r, const Graph& graph) {
  std::printf("%s: %lld edits, %lld solves, %lld adoptions; at its end %zu variables and %zu factors\n",
              a.journal.c_str(), static_cast<long long>(r.edits), static_cast<long long>(r.solves),
              static_cast<long long>(r.adoptions), graph.variable_count(), graph.factor_count());
  const char* what = a.options.verify ? "solved again" : "taken over";
  if (r.differing == 0)
    std::printf("%s: the same bits after every solve\n", what);
  else
    std::printf("%s: other bits after %lld of %lld solves, first after solve %lld\n", what,
                static_cast<long long>(r.differing), static_cast<long long>(r.solves),
                static_cast<long long>(r.first_differing) + 1);
  if (r.differing > 0 && r.build != build_name())
    std::printf("the journal was written by a build for %s, this one is for %s\n", r.build.c_str(),
                std::string(build_name()).c_str());
}

int run(const ReplayArguments& a) {
  Graph graph;
  const auto report = replay(a.journal, shipped_types(), a.options, graph);
  if (!report) return refuse(report.error());
  print(a, *report, graph);
  if (report->damage) return refuse(*report->damage);
  return report->differing == 0 ? kSolved : kNotConverged;
}

}  // namespace

void add_replay_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<ReplayArguments>();
  CLI::App* command = app.add_subcommand("replay", "Rebuilds the graph of a journal (oriel run --journal)");
  command->add_option("JOURNAL", a->journal, "The file")->required();
  command->add_flag("--verify", a->options.verify, "Solve again, and say whether the bits are the same");
  command->add_option("--threads", a->options.threads, "Of the solves; as recorded where it is not given")
      ->check(CLI::PositiveNumber);
  command->add_flag("--drop-caches", a->options.drop_caches, "Forget every cache before each solve");
  command->callback([a, &exit_code] { exit_code = run(*a); });
}

}  // namespace oriel::apps
