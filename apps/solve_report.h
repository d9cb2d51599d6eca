// What `oriel solve` says of a file: for people, and as JSON.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "apps/covariance_report.h"

namespace oriel::apps {

struct SolvedFile {
  std::string path, format, gauge;
  std::size_t poses = 0, landmarks = 0, factors = 0;
  std::int64_t self_edges_left_out = 0, information_repaired = 0;
  PoseStart start = PoseStart::file;
  int threads = 1;
  double read_seconds = 0.0, setup_seconds = 0.0, total_seconds = 0.0;  // total: writing the result included
  double peak_rss_mb = 0.0;
  std::vector<std::string> undetermined;
  Summary summary;  // graduated: of the last round, its cost before and its iterations those of all
  struct Graduated {
    int rounds = 0;
    std::int64_t factors = 0, outliers = 0;
  };
  std::optional<Graduated> graduated;
  std::vector<CovarianceBlock> covariances;

  // A factor whose residual is no number is left out of the cost; the minimum of the rest is no answer to the file.
  bool converged() const { return summary.converged() && summary.not_finite_factors == 0; }
  std::string reason() const;
};

// One array, one object a file; its keys are described in docs/command.md. NaN and infinities are null.
std::string solve_json(const std::vector<SolvedFile>& files);
// verbose: every iteration and the time of every stage too.
std::string solve_text(const SolvedFile& file, bool verbose = false);

}  // namespace oriel::apps
