// Real false loop closures, against the ground truth of the same drive.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "oriel/evaluate/align.h"
#include "oriel/evaluate/report.h"
#include "oriel/io/problem.h"
#include "oriel/solve/graduated.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

const std::string kFolder = std::string(ORIEL_SHARED_DIR) + "/g2o/outliers/";

struct Drive {
  Graph graph;
  PoseGraph2 ids;

  Drive(const std::string& name, const Loss& loss, bool loops) {
    const auto file = read_g2o(kFolder + name);
    EXPECT_TRUE(file) << file.error();
    PoseGraphOptions options;
    options.start = PoseStart::odometry;
    options.loss = loss;
    options.loss_on_loops = loops;
    auto added = add_pose_graph2(graph, *file, options);
    EXPECT_TRUE(added) << added.error();
    ids = *added;
  }

  // Root mean square of the positions' errors after a rigid alignment [m]. Node k has the time on line k + 1 of one
  // file; the nearest pose of the other within 0.1 s is its truth.
  double rmse() const {
    std::vector<double> stamps;
    std::ifstream times(kFolder + "B25b_timestamps.txt");
    for (double t = 0.0; times >> t;) stamps.push_back(t);
    std::vector<std::pair<double, Vec3d>> truth;
    std::ifstream lines(kFolder + "Bicocca_2009-02-25b-GT-extended.csv");
    for (std::string line; std::getline(lines, line);) {
      std::replace(line.begin(), line.end(), ',', ' ');
      double t = 0.0, x = 0.0, y = 0.0;
      if (std::istringstream(line) >> t >> x >> y) truth.emplace_back(t, Vec3d{x, y, 0.0});
    }
    std::vector<Vec3d> estimate, true_positions;
    for (std::size_t k = 0; k < stamps.size() && k < ids.poses.size(); ++k) {
      const auto near = std::min_element(truth.begin(), truth.end(), [&](const auto& a, const auto& b) {
        return std::fabs(a.first - stamps[k]) < std::fabs(b.first - stamps[k]);
      });
      if (std::fabs(near->first - stamps[k]) >= 0.1) continue;
      const Vec2d& p = graph.value(ids.poses[k]).t;
      estimate.push_back({p[0], p[1], 0.0});
      true_positions.push_back(near->second);
    }
    EXPECT_GT(estimate.size(), 6000u);
    const auto moved = align(estimate, true_positions, Alignment::se3);
    EXPECT_TRUE(moved);
    double sum = 0.0;
    for (std::size_t i = 0; i < estimate.size(); ++i)
      sum += std::pow(((*moved)(estimate[i]) - true_positions[i]).norm(), 2);
    return std::sqrt(sum / static_cast<double>(estimate.size()));
  }
};

SolveOptions patient() {
  SolveOptions options;
  options.max_iterations = 200;
  return options;
}

// L8
TEST(RealOutliers, WreckLeastSquaresAndNotARobustLossOnTheLoops) {
  Drive plain("B25b_0.000.g2o", Loss::none(), true), robust("B25b_0.000.g2o", Cauchy(1.0), true);
  (void)NativeEngine(plain.graph).solve(patient());
  const Summary s = NativeEngine(robust.graph).solve(patient());
  EXPECT_TRUE(s.converged()) << s;
  EXPECT_GT(plain.rmse(), 30.0);
  EXPECT_LE(robust.rmse(), 1.1);
}

// L8
TEST(RealOutliers, AreLeftOutByGraduationNoWorse) {
  Drive drive("B25b_0.000.g2o", GemanMcClure(std::sqrt(3.0)), true);
  NativeEngine engine(drive.graph);
  GraduatedOptions options;
  options.solve = patient();
  const auto report = solve_graduated(drive.graph, engine, options);
  ASSERT_TRUE(report) << report.error();
  EXPECT_TRUE(report->summary.converged()) << report->summary;
  EXPECT_EQ(report->graduated, 446);
  EXPECT_GT(report->outliers.size(), 250u);
  EXPECT_LE(drive.rmse(), 1.08);
}

// Half of the robust cost that the data's README gives, which is Σρ.
TEST(RealOutliers, OutdoorsEndAtTheKnownRobustCost) {
  Drive drive("Bovisa06_odometry_bow_tr.g2o", Cauchy(1.0), true);
  const Summary s = NativeEngine(drive.graph).solve(patient());
  EXPECT_TRUE(s.converged()) << s;
  EXPECT_LE(s.final_cost, 0.5 * 608.70 * (1.0 + 1e-6));
}

}  // namespace
}  // namespace oriel
