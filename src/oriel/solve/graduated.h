// Graduated non-convexity: an outer loop for losses that have many minima. The loss of every factor that has a
// truncated or a Geman–McClure one begins as nearly squares, at the least-squares solution, and is brought to what it
// is in steps, each solved from the last. H. Yang, P. Antonante, V. Tzoumas, L. Carlone, Graduated Non-Convexity for
// Robust Spatial Perception, RA-L 2020: truncated squares eq. 6, μ rising from c²/(2 s_max - c²) (remark 5);
// Geman–McClure eq. 4, μ falling from 2 s_max/c² to 1 (there: rising factor 1.4, as here). Instead of weights in turn
// with least squares, each step minimizes its own loss.
#pragma once
#include <vector>

#include "oriel/solve/engine.h"

namespace oriel {

struct GraduatedOptions {
  SolveOptions solve;         // of every round
  double growth = 1.4;        // of μ between two rounds, > 1
  int max_rounds = 100;       // then the loss is what it is, all the same
  int round_iterations = 10;  // of each round but the last, which has those of `solve`
};

struct GraduatedReport {
  Summary summary;                 // of the last round: the losses as they were given; or of the round that failed
  int rounds = 0, iterations = 0;  // all rounds
  std::int64_t graduated = 0;      // factors whose loss was graduated
  std::vector<FactorId> outliers;  // those of them that the solution puts beyond the scale of their loss
};

// The factors keep their ids. Losses that a user sets from a callback meanwhile are lost. If a round fails, the losses
// are as they were and the values those of the round before. An Error where the graph refuses an edit (never as long as
// nobody else removes factors meanwhile).
Result<GraduatedReport> solve_graduated(Graph& graph, Engine& engine, const GraduatedOptions& options = {});

}  // namespace oriel
