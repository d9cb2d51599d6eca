// Checks of option values. A fault reads "--name: expected ..., found '...'".
#pragma once
#include <CLI/App.hpp>  // Validators.hpp does not stand alone
#include <string>
#include <vector>

namespace oriel::apps {

CLI::Validator whole_number(long long least, long long most);
CLI::Validator number(double least, double most);
CLI::Validator one_of(std::vector<std::string> words);

// --init, of all commands that start pose graphs; start_choice() knows its words.
void add_start_option(CLI::App& command, std::string& choice);
// --engine, of all commands that solve by one of engine_choice.h.
void add_engine_option(CLI::App& command, std::string& choice);

}  // namespace oriel::apps
