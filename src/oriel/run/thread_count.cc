#include "oriel/run/thread_count.h"

#include <dirent.h>

namespace oriel {

int thread_count() {
  DIR* tasks = ::opendir("/proc/self/task");
  if (tasks == nullptr) return 1;
  int n = 0;
  while (const dirent* entry = ::readdir(tasks)) n += entry->d_name[0] != '.';
  ::closedir(tasks);
  return n;
}

}  // namespace oriel
