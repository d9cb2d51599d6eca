// What all subcommands share: how one joins the command line, its exit codes, and how files leave it.
//
// A subcommand is one file, xyz_command.cc, with one function `void add_xyz_command(CLI::App& app, int& exit_code)`: it
// calls app.add_subcommand("xyz", ...), adds its options, and gives CLI11 a callback that does the work and stores an
// exit code. It is declared in commands.h and named in the list of main.cc. Standard output is for results; progress
// and the one line of an error go to standard error.
#pragma once
#include <string>
#include <string_view>

#include "oriel/base/result.h"

namespace CLI {
class App;
}

namespace oriel::apps {

inline constexpr int kSolved = 0;        // or: done
inline constexpr int kNotConverged = 1;  // or: the deadline came first
inline constexpr int kBadInput = 2;      // or: a wrong command line; then nothing was written

// One line on standard error: "oriel: file:line: what was expected". Returns kBadInput.
int refuse(const Error& error);

// A path that results will be written to: its folder must be there and writable. Asked before any work is done.
// Empty and "-" are fine.
Result<void> check_target(const std::string& path);

// "-" is standard output; a file is written beside its target and renamed.
Result<void> write_output(const std::string& path, std::string_view text);

// Of this process, so far [MB = 1e6 bytes].
double peak_rss_mb();

}  // namespace oriel::apps
