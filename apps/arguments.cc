#include "apps/arguments.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "apps/engine_choice.h"
#include "oriel/io/text.h"

namespace oriel::apps {
namespace {

CLI::Validator validator(std::string shown, std::string expected, std::function<bool(const std::string&)> fits) {
  const auto check = [expected = std::move(expected), fits = std::move(fits)](std::string& value) {
    return fits(value) ? std::string() : "expected " + expected + ", found " + quote_token(value);
  };
  return CLI::Validator(check, std::move(shown));
}

std::string shortest(double value) {
  std::string text;
  append_number(text, value);
  return text;
}

}  // namespace

CLI::Validator whole_number(long long least, long long most) {
  const std::string range = std::to_string(least) + " to " + std::to_string(most);
  return validator("", "a whole number from " + range, [=](const std::string& value) {
    std::int64_t n = 0;
    return parse_integer(value, n) == NumberFault::none && n >= least && n <= most;
  });
}

CLI::Validator number(double least, double most) {
  const std::string range = shortest(least) + " to " + shortest(most);
  return validator("", "a number from " + range, [=](const std::string& value) {
    double x = 0;
    return parse_number(value, x) == NumberFault::none && x >= least && x <= most;
  });
}

CLI::Validator one_of(std::vector<std::string> words) {
  std::string list, shown;
  for (std::size_t i = 0; i < words.size(); ++i) {
    list += (i == 0 ? "" : i + 1 < words.size() ? ", " : " or ") + words[i];
    shown += (i == 0 ? "" : "|") + words[i];
  }
  return validator(shown, list, [words = std::move(words)](const std::string& value) {
    return std::find(words.begin(), words.end(), value) != words.end();
  });
}

void add_start_option(CLI::App& command, std::string& choice) {
  command.add_option("--init", choice, "Start of the poses; auto: the one of lower cost")
      ->check(one_of({"file", "odometry", "tree", "chordal", "auto"}))
      ->capture_default_str();
}

void add_engine_option(CLI::App& command, std::string& choice) {
  command.add_option("--engine", choice, "native, or ceres where it is built (oriel-ceres)")
      ->check(one_of(engines().list()))
      ->capture_default_str();
}

}  // namespace oriel::apps
