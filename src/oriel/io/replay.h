// Replaying a journal: the graph as it was, and whether its solves come to the same bits again.
#pragma once
#include <optional>
#include <string>

#include "oriel/io/journal.h"

namespace oriel {

struct ReplayOptions {
  bool verify = false;       // solve again, and compare; else what was found then is taken over
  int threads = 0;           // of the solves; 0: as recorded
  bool drop_caches = false;  // before every solve
};

struct ReplayReport {
  std::string build;  // that wrote the journal
  std::int64_t messages = 0, edits = 0, solves = 0, adoptions = 0;
  std::int64_t differing = 0;         // states of the graph whose fingerprint is not the recorded one
  std::int64_t first_differing = -1;  // the solve where that was, from 0
  std::optional<Error> damage;        // where the journal stops being readable
};

// Brings `graph`, which must be empty, to the state of the journal's end, or of its damage. An error only where the
// file is no journal, or says something that cannot be: of unknown types, or an edit that its graph refuses.
Result<ReplayReport> replay(const std::string& path, const TypeList& types, const ReplayOptions& options, Graph& graph);

}  // namespace oriel
