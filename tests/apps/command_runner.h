// Runs the command as a shell would, in a folder of its own that is gone afterwards.
#pragma once
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

namespace oriel::apps {

struct CommandResult {
  int exit_code = -1;  // -1: ended by a signal
  std::string out, err;
  nlohmann::json json() const { return nlohmann::json::parse(out, nullptr, false); }  // discarded where it is none
};

class CommandTest : public testing::Test {
 protected:
  CommandTest() {
    std::string name = testing::TempDir() + "oriel-command-XXXXXX";
    folder_ = ::mkdtemp(name.data());
  }
  ~CommandTest() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  std::string path(const std::string& name) const { return folder_ / name; }

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }

  static std::string read(const std::string& file) {
    std::ostringstream text;
    text << std::ifstream(file, std::ios::binary).rdbuf();
    return text.str();
  }

  CommandResult oriel(const std::string& arguments) const { return shell(ORIEL_COMMAND " " + arguments); }
  CommandResult shell(const std::string& line) const {
    const std::string out = path("stdout"), err = path("stderr");
    const int status = std::system((line + " >" + out + " 2>" + err).c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read(out), read(err)};
  }

  // The object of the only file.
  nlohmann::json solve(const std::string& arguments) const {
    const nlohmann::json array = oriel("solve " + arguments + " --json -").json();
    return array.is_array() && array.size() == 1 ? array[0] : nlohmann::json();
  }

 private:
  std::filesystem::path folder_;
};

inline std::string data(const std::string& name) { return ORIEL_DATA_DIR "/" + name; }

}  // namespace oriel::apps
