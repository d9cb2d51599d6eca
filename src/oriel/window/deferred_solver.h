// A solver that works while its caller goes on: begun at one point of a window's data, merged at a later one. The
// window knows no threads; whoever makes one does (run/window_solver.h).
#pragma once
#include <string_view>

#include "oriel/base/result.h"
#include "oriel/solve/options.h"
#include "oriel/solve/summary.h"

namespace oriel {

class DeferredSolver {
 public:
  virtual ~DeferredSolver() = default;
  virtual std::string_view name() const = 0;
  // Takes what changed in its graph since the last time, and comes back at once. An error: nothing was begun.
  virtual Result<void> begin(const SolveOptions& options) noexcept = 0;
  // Whether what was begun is still worked at; never waits.
  virtual bool is_running() noexcept = 0;
  // Waits, and the graph adopts what was found, but for what is gone, fixed or was set since. What cannot be had any
  // more is Reason::refused, with words.
  virtual Summary finish() noexcept = 0;
};

}  // namespace oriel
