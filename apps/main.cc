// oriel: the command. Its subcommands, options and JSON are described in docs/command.md.
#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>

#include "apps/command.h"
#include "apps/commands.h"
#include "oriel/io/text.h"

namespace oriel::apps {
namespace {

// A subcommand takes part by standing here.
constexpr AddCommand kCommands[] = {
    add_solve_command,  add_compare_command, add_info_command,     add_import_command, add_simulate_command,
    add_nees_command,   add_soak_command,    add_evaluate_command, add_run_command,    add_track_command,
    add_config_command, add_replay_command,  add_demo_command,
};

// CLI11 explains itself in several lines where it has several things to say; an error of ours is one.
std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

// CLI11 would say no more than that one is missing.
std::string unknown_subcommand(const CLI::App& app, std::string_view found) {
  std::string names;
  for (const CLI::App* command : app.get_subcommands({})) names += (names.empty() ? "" : ", ") + command->get_name();
  return "expected one of " + names + ", found " + quote_token(found);
}

int parse_and_run(int argc, char** argv) {
  CLI::App app("Real-time state estimation: pose graphs, bundle adjustment, visual-inertial windows.", "oriel");
  app.set_version_flag("--version", std::string("oriel ") + ORIEL_VERSION);
  app.require_subcommand(1);
  app.footer("Exit codes: 0 solved, 1 not converged or deadline, 2 bad input or usage (then nothing is written).");
  int exit_code = kSolved;
  for (const AddCommand add : kCommands) add(app, exit_code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help, --version
    const bool unknown = app.get_subcommands().empty() && argc > 1 && argv[1][0] != '-';
    const std::string fault = unknown ? unknown_subcommand(app, argv[1]) : first_line(e.what());
    return refuse({ErrorCode::bad_input, fault + " (see oriel --help)"});
  }
  return exit_code;
}

}  // namespace
}  // namespace oriel::apps

int main(int argc, char** argv) {
  try {
    return oriel::apps::parse_and_run(argc, argv);
  } catch (const std::exception& e) {  // above all: no memory for what a file announces
    return oriel::apps::refuse({oriel::ErrorCode::bad_input, std::string("gave up: ") + e.what()});
  }
}
