// How a solve went: the cost by time.
#pragma once
#include <cmath>
#include <string>
#include <vector>

namespace oriel::benchmark {

struct TracePoint {
  double seconds = 0.0, cost = 0.0;  // since the call of the solver, ordering and symbolic work included
};
struct Trace {
  std::vector<TracePoint> points;
  double total = 0.0;  // [s] of the call
  int iterations = 0;
};

inline double best_cost(const Trace& trace) {
  double best = HUGE_VAL;
  for (const TracePoint& p : trace.points)
    if (p.cost < best) best = p.cost;
  return best;
}
// When the cost was at or below the target for the first time; infinite if never.
inline double time_to(const Trace& trace, double target) {
  for (const TracePoint& p : trace.points)
    if (p.cost <= target) return p.seconds;
  return HUGE_VAL;
}

}  // namespace oriel::benchmark
