// What tests look at that leave nothing behind.
#pragma once
#include <dirent.h>
#include <sys/types.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

namespace oriel {

// Processes whose parent is that one.
inline std::set<pid_t> children_of(pid_t parent) {
  std::set<pid_t> out;
  DIR* processes = ::opendir("/proc");
  while (const dirent* entry = ::readdir(processes)) {
    std::ifstream stat(std::string("/proc/") + entry->d_name + "/stat");
    std::string text;
    if (!std::getline(stat, text)) continue;
    const auto at = text.rfind(')');
    char state = 0;
    pid_t of = 0;
    if (std::sscanf(text.c_str() + at + 1, " %c %d", &state, &of) == 2 && of == parent)
      out.insert(std::atoi(entry->d_name));
  }
  ::closedir(processes);
  return out;
}

// Whether it has none, after at most two seconds: a worker that was late is not waited for, but goes.
inline bool goes_childless(pid_t parent) {
  for (int i = 0; i < 200 && !children_of(parent).empty(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return children_of(parent).empty();
}

// Whether it ends within five seconds, with all its threads; one that nobody waits for has gone, too.
inline bool goes(pid_t pid) {
  for (int i = 0; i < 500; ++i) {
    std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
    std::string text;
    if (!std::getline(stat, text)) return true;
    std::istringstream fields(text.substr(text.rfind(')') + 1));
    std::vector<std::string> field(18);  // the state comes first, how many threads there are last
    for (std::string& f : field) fields >> f;
    if (field[0] == "Z" && std::atoi(field[17].c_str()) <= 1) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;  // some ten times slower
#else
inline constexpr bool kSanitized = false;
#endif
inline constexpr bool kMayLimitMemory = !kSanitized;  // shadow memory is larger than any limit

// Open files of this process, memory that is shared among them.
inline int descriptor_count() {
  int n = 0;
  DIR* fds = ::opendir("/proc/self/fd");
  while (const dirent* entry = ::readdir(fds)) n += entry->d_name[0] != '.';
  ::closedir(fds);
  return n - 1;
}

}  // namespace oriel
