// What can be said of a problem before it is solved: how much of what, how it hangs together, what nothing holds, and
// which of its lines look wrong.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "oriel/io/bal.h"
#include "oriel/io/g2o.h"

namespace oriel {

struct ProblemFacts {
  struct Count {
    std::string what;
    std::size_t count;
  };
  struct Spread {  // how many edges a node has
    std::size_t least = 0, median = 0, most = 0;
    double mean = 0.0;
  };
  struct Component {
    std::size_t poses = 0, landmarks = 0;
    std::string first;  // the name of its first pose, or of its landmark
    std::string free;   // what no edge and no FIX determines, empty where nothing is free
  };
  struct Suspicion {
    std::string kind;     // self, repeated, indefinite, far
    std::int64_t line;    // of the file
    std::string what;     // "EDGE_SE2 12 40"
    double sigmas = 0.0;  // far: the norm of its whitened residual
  };

  std::vector<Count> counts;  // by type
  Spread pose_degree, landmark_degree;
  std::size_t poses_alone = 0;        // no edge at all
  std::size_t landmarks_once = 0;     // seen once
  std::vector<Component> components;  // the largest first
  std::string start;                  // where residuals were taken: "file" or "odometry"
  double cost = 0.0;                  // ½Σ‖r‖² there, whitened
  std::size_t edges = 0;              // with a residual
  std::vector<Count> suspicious;      // by kind
  std::vector<Suspicion> examples;    // at most kExamples of each kind; of far ones the farthest
  static constexpr std::size_t kExamples = 10;
};

// An edge is far where a right model would have such a residual once in 1e9 edges (χ²).
inline constexpr double kFarProbability = 1e-9;

ProblemFacts facts_of(const PoseGraphFile& file);
ProblemFacts facts_of(const BalFile& file);  // sigma 1 px; what is repeated is a camera's second sight of a point

}  // namespace oriel
