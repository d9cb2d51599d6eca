// For tests that kill workers.
#pragma once
#include <fstream>
#include <string>

#include "oriel/run/zygote.h"

namespace oriel {

// The first worker that a zygote has now; -1: none.
inline pid_t worker_of(const Zygote& zygote) {
  const std::string pid = std::to_string(zygote.pid());
  std::ifstream children("/proc/" + pid + "/task/" + pid + "/children");
  pid_t worker = -1;
  children >> worker;
  return worker;
}

}  // namespace oriel
