// The table of a run's settings: read, checked and printed by it. Private to run_config.cc.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <variant>

#include "oriel/io/run_config.h"

namespace oriel::io_detail {

// Where a setting is; what it is follows from the type.
template <class T>
using Setting = T& (*)(RunConfig&);
// A word out of several; `get` and `set` by its place among them.
struct Word {
  const char* words;  // separated by blanks
  int (*get)(const RunConfig&);
  void (*set)(RunConfig&, int);
};

struct Real {
  Setting<double> at;
  double least, greatest;
};
struct Whole {
  Setting<int> at;
  int least, greatest;
};
struct Count {
  Setting<std::uint64_t> at;
};
struct Seconds {
  Setting<Duration> at;
  bool may_be_zero = false;
};
struct Flag {
  Setting<bool> at;
};
struct Robust {
  Setting<Loss> at;
};

struct ConfigKey {
  const char* section;  // empty: top
  const char* name;
  std::variant<Word, Real, Whole, Count, Seconds, Flag, Robust> kind;
  const char* unit;
  const char* sentence;
  bool required = false;
};
std::span<const ConfigKey> run_config_keys();

}  // namespace oriel::io_detail
