// Published pairs of estimate and truth, against the figures that come with them.
#include <gtest/gtest.h>

#include <string>

#include "oriel/evaluate/report.h"

namespace oriel {
namespace {

EvaluationReport evaluated(const std::string& estimate, const std::string& truth, EvaluationOptions options) {
  const std::string folder = std::string(ORIEL_SHARED_DIR) + "/vio/trajectories/";
  const auto report = evaluate_files(folder + estimate, folder + truth, options);
  EXPECT_TRUE(report) << report.error();
  return report ? *report : EvaluationReport{};
}

TEST(PublishedTrajectories, KittiHasItsErrorForEachAlignment) {
  const auto ate = [](Alignment alignment) {
    EvaluationOptions options;
    options.alignment = alignment;
    return evaluated("evo/KITTI_00_ORB.txt", "evo/KITTI_00_gt.txt", options);
  };
  const EvaluationReport rigid = ate(Alignment::se3);
  EXPECT_EQ(rigid.pairs, 4541u);
  EXPECT_NEAR(rigid.path_m, 3724.2, 0.05);
  EXPECT_NEAR(rigid.absolute.position.rmse, 1.3034, 5e-5);
  const EvaluationReport scaled = ate(Alignment::sim3);
  EXPECT_NEAR(scaled.absolute.position.rmse, 0.9377, 5e-5);
  EXPECT_NEAR(scaled.absolute.alignment.scale, 1.0047, 5e-5);
  EXPECT_NEAR(ate(Alignment::none).absolute.position.rmse, 7.790, 5e-4);
}

TEST(PublishedTrajectories, Freiburg1XyzHasItsPairsAndError) {
  const EvaluationReport report = evaluated("evo/freiburg1_xyz-rgbdslam.txt", "evo/freiburg1_xyz-groundtruth.txt", {});
  EXPECT_EQ(report.pairs, 785u);
  EXPECT_NEAR(report.absolute.position.rmse, 0.0135, 5e-5);
}

TEST(PublishedTrajectories, EurocV201HasItsPairsAndErrors) {
  EvaluationOptions options;
  options.max_dt = {5'000'000};
  const std::string truth = "euroc_svo_rpg/V2_01_groundtruth.txt";
  const EvaluationReport mono = evaluated("euroc_svo_rpg/V2_01_vio_mono_estimate.txt", truth, options);
  EXPECT_EQ(mono.pairs, 2165u);
  EXPECT_NEAR(mono.absolute.position.rmse, 0.0848, 5e-5);
  const EvaluationReport stereo = evaluated("euroc_svo_rpg/V2_01_vio_stereo_estimate.txt", truth, options);
  EXPECT_EQ(stereo.pairs, 2240u);
  EXPECT_NEAR(stereo.absolute.position.rmse, 0.0536, 5e-5);
}

}  // namespace
}  // namespace oriel
