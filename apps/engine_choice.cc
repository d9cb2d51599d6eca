#include "apps/engine_choice.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

extern char** environ;  // POSIX has it in no header

namespace oriel::apps {
namespace {

std::filesystem::path this_program() {
  std::error_code ignored;
  return std::filesystem::read_symlink("/proc/self/exe", ignored);
}

std::vector<char*> pointers(std::vector<std::string>& words) {
  std::vector<char*> out;
  out.reserve(words.size() + 1);
  for (std::string& w : words) out.push_back(w.data());
  out.push_back(nullptr);
  return out;
}

Error system_error(const std::string& what, int code) { return {ErrorCode::io, what + ": " + std::strerror(code)}; }

// The read end of a pipe that a child writes to.
class Pipe {
 public:
  Pipe() { ok_ = ::pipe2(ends_, O_CLOEXEC) == 0; }
  ~Pipe() {
    close(0);
    close(1);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  bool ok() const { return ok_; }
  int end(int which) const { return ends_[which]; }
  void close(int which) {
    if (ok_ && ends_[which] >= 0) ::close(ends_[which]);
    ends_[which] = -1;
  }
  std::string read_all() {
    std::string text;
    char buffer[65536];
    for (;;) {
      const ssize_t n = ::read(ends_[0], buffer, sizeof(buffer));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return text;
      text.append(buffer, static_cast<std::size_t>(n));
    }
  }

 private:
  int ends_[2] = {-1, -1};
  bool ok_ = false;
};

}  // namespace

std::unique_ptr<Engine> make_engine(std::string_view name, Graph& graph) {
  const NameTable<NamedEngine> all = engines();
  const NamedEngine* engine = all.get(name);
  return engine != nullptr && engine->make != nullptr ? engine->make(graph) : nullptr;
}

bool has_engine(std::string_view name) {
  const NameTable<NamedEngine> all = engines();
  const NamedEngine* engine = all.get(name);
  return engine != nullptr && engine->make != nullptr;
}

Result<std::string> program_of(std::string_view engine) {
  const std::filesystem::path self = this_program();
  if (has_engine(engine)) return self.string();
  const std::filesystem::path other = self.parent_path() / "oriel-ceres";
  if (::access(other.c_str(), X_OK) == 0) return other.string();
  return Error{ErrorCode::bad_input, "engine " + std::string(engine) + ": expected the program " + other.string() +
                                         ", which is built where Ceres is found"};
}

Error become(const std::string& program) {
  std::ifstream in("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> words;
  for (std::string word; std::getline(in, word, '\0');) words.push_back(word);
  std::vector<char*> argv = pointers(words);
  ::execv(program.c_str(), argv.data());
  return system_error(program, errno);
}

Error become_one_with(std::string_view engine) {
  const Result<std::string> program = program_of(engine);
  return program ? become(*program) : program.error();
}

Result<std::string> output_of(const std::string& program, const std::vector<std::string>& arguments, int& exit_code) {
  Pipe pipe;
  if (!pipe.ok()) return system_error("pipe", errno);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, pipe.end(1), STDOUT_FILENO);
  std::vector<std::string> words = {"oriel"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv = pointers(words);
  pid_t child = -1;
  const int failed = ::posix_spawn(&child, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) return system_error(program, failed);
  pipe.close(1);
  std::string text = pipe.read_all();
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return system_error("waitpid", errno);
  if (!WIFEXITED(status))
    return Error{ErrorCode::io, program + ": ended by signal " + std::to_string(WTERMSIG(status))};
  exit_code = WEXITSTATUS(status);
  return text;
}

}  // namespace oriel::apps
