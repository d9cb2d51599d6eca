// Problem files on Ceres as an expert of Ceres would write them: analytic cost functions in fixed sizes, raw parameters
// without a manifold where that is possible, points first in the elimination order, and every setting that is known to
// help. Nothing of Oriel's engine is in it.
#pragma once
#include <ceres/ceres.h>

#include <string>
#include <vector>

#include "benchmarks/support/trace.h"
#include "oriel/io/bal.h"
#include "oriel/io/g2o.h"

namespace oriel::benchmark {

struct CeresFileSetting {
  std::string name;
  ceres::LinearSolverType solver = ceres::SPARSE_NORMAL_CHOLESKY;
  ceres::TrustRegionStrategyType strategy = ceres::LEVENBERG_MARQUARDT;
  ceres::DoglegType dogleg = ceres::TRADITIONAL_DOGLEG;
  // The default of 1e4 makes pose graphs 3 to 4 times slower: their start is best left to Gauss–Newton.
  double radius = 1e4;
  ceres::DenseLinearAlgebraLibraryType dense = ceres::EIGEN;
};
std::vector<CeresFileSetting> ceres_settings_for_pose_graphs();
std::vector<CeresFileSetting> ceres_settings_for_bundle_adjustment();

struct CeresFileOptions {
  int threads = 1, max_iterations = 100;
  double function_tolerance = 1e-9;
};
// From the file's start; the first pose, or what FIX names, is held. Making the Problem is not in the times.
Trace solve_with_ceres(const PoseGraphFile& file, const CeresFileSetting& setting, const CeresFileOptions& options);
Trace solve_with_ceres(const BalFile& file, const CeresFileSetting& setting, const CeresFileOptions& options);

}  // namespace oriel::benchmark
