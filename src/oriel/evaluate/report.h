// One estimate against one truth: everything that `oriel evaluate` says.
#pragma once
#include <string>

#include "oriel/evaluate/ate.h"
#include "oriel/evaluate/rpe.h"

namespace oriel {

struct EvaluationOptions {
  Alignment alignment = Alignment::se3;
  Duration max_dt{10'000'000};            // of a pair of stamps
  double relative_distance_m = 10;        // for the relative error over a way
  Duration relative_time{1'000'000'000};  // and over a time; of no use without stamps
};

struct EvaluationReport {
  std::string estimate_file, truth_file;
  EvaluationOptions options;
  std::size_t estimate_poses = 0, truth_poses = 0, pairs = 0;
  bool stamped = true;
  double duration_s = 0;  // from the first pair to the last, 0 without stamps
  double path_m = 0;      // of the truth, from the first pair to the last, all its poses counted
  AbsoluteError absolute;
  RelativeError over_distance, over_time;
};

Result<EvaluationReport> evaluate(TrajectoryFile estimate, TrajectoryFile truth, const EvaluationOptions& options);
Result<EvaluationReport> evaluate_files(const std::string& estimate, const std::string& truth,
                                        const EvaluationOptions& options);

std::string to_text(const EvaluationReport& report);  // a small table with units
std::string to_json(const EvaluationReport& report);  // one object; numbers that are not finite are null

}  // namespace oriel
