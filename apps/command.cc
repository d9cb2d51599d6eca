#include "apps/command.h"

#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "oriel/io/text.h"

namespace oriel::apps {

int refuse(const Error& error) {
  std::fprintf(stderr, "oriel: %s\n", error.text().c_str());
  return kBadInput;
}

Result<void> check_target(const std::string& path) {
  if (path.empty() || path == "-") return {};
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    return Error{ErrorCode::io, "expected a file to write, found a directory", path};
  if (::access(path.c_str(), W_OK) == 0) return {};
  if (errno != ENOENT) return Error{ErrorCode::io, std::string("cannot be written: ") + std::strerror(errno), path};
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (::access(folder.empty() ? "." : folder.c_str(), W_OK | X_OK) == 0) return {};
  return Error{ErrorCode::io, std::string("cannot be written, its folder: ") + std::strerror(errno), path};
}

Result<void> write_output(const std::string& path, std::string_view text) {
  if (path != "-") return write_text_file(path, text);
  const bool written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  if (!written)
    return Error{ErrorCode::io, std::string("cannot be written: ") + std::strerror(errno), "standard output"};
  return {};
}

double peak_rss_mb() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024.0 / 1e6;  // Linux counts in KiB
}

}  // namespace oriel::apps
