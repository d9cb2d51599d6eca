// Engines by name. Ceres and what it needs are 20 MB of libraries: they are in a program of their own, oriel-ceres, the
// same command with one more engine, which this one becomes where that engine is asked for.
#pragma once
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/run/run_names.h"

namespace oriel::apps {

// By name; those without a maker are not of this program. Defined in apps/engine/, once for each program.
NameTable<NamedEngine> engines();
// Null: this program does not have it.
std::unique_ptr<Engine> make_engine(std::string_view name, Graph& graph);
bool has_engine(std::string_view name);

// The program that has the engine: this one, or oriel-ceres beside it. An error where there is none.
Result<std::string> program_of(std::string_view engine);

// This process goes on as that program, with the arguments it was called with. Returns only where that fails.
Error become(const std::string& program);
Error become_one_with(std::string_view engine);

// Runs `oriel ARGUMENTS` in a child process with that program, until it ends, and gives what it wrote to its standard
// output. `exit_code`: its own; an error where it did not end by itself.
Result<std::string> output_of(const std::string& program, const std::vector<std::string>& arguments, int& exit_code);

}  // namespace oriel::apps
