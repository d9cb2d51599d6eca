// oriel config [FILE]
#include <CLI/App.hpp>
#include <memory>

#include "apps/arguments.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "oriel/io/run_config.h"

namespace oriel::apps {
namespace {

// Every fault, a line each, and nothing on standard output.
int refuse_all(const std::vector<Error>& errors) {
  for (const Error& e : errors) refuse(e);
  return kBadInput;
}

int print_config(const std::string& file) {
  RunConfig config = default_run_config(shipped_names());
  if (!file.empty()) {
    RunConfigReading reading = read_run_config(file);
    if (!reading.errors.empty()) return refuse_all(reading.errors);
    config = reading.config;
  }
  if (auto ok = write_output("-", run_config_text(config)); !ok) return refuse(ok.error());
  return kSolved;
}

}  // namespace

void add_config_command(CLI::App& app, int& exit_code) {
  const auto file = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand(
      "config", "Every setting of a run with its value, unit and meaning, as a file that `oriel run --config` takes");
  command->add_option("FILE", *file, "A config to check; its values are printed in place of the defaults");
  command->callback([file, &exit_code] { exit_code = print_config(*file); });
}

}  // namespace oriel::apps
