// The public data sets: counts as their description gives them.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "oriel/io/bal.h"
#include "oriel/io/euroc_import.h"
#include "oriel/io/g2o.h"

namespace oriel {
namespace {

const std::string kData = ORIEL_SHARED_DIR;

void expect_graph(const std::string& file, std::size_t poses, std::size_t edges, bool has_vertices = true) {
  const auto graph = read_g2o(kData + "/g2o/" + file);
  ASSERT_TRUE(graph) << graph.error();
  EXPECT_EQ(graph->ids.size(), poses) << file;
  EXPECT_EQ(
      graph->planar_edges.size() + graph->spatial_edges.size() + static_cast<std::size_t>(graph->self_edges_left_out),
      edges)
      << file;
  EXPECT_EQ(graph->has_vertices, has_vertices) << file;
}

TEST(G2oFiles, HaveThePosesAndEdgesOfTheirDescription) {
  expect_graph("2d/intel.g2o", 1728, 2512);
  expect_graph("2d/manhattan.g2o", 3500, 5453, false);
  expect_graph("2d/CSAIL.g2o", 1045, 1172, false);
  expect_graph("2d/MIT.g2o", 808, 827);
  expect_graph("2d/city10000.g2o", 10000, 20687);
  expect_graph("2d/kitti_00.g2o", 4541, 4677, false);
  expect_graph("2d/M3500.g2o", 3500, 5453);
  expect_graph("2d/manhattanOlson3500.g2o", 3500, 5598);
  expect_graph("2d/ringCity.g2o", 2361, 3261);
  expect_graph("3d/sphere2500.g2o", 2500, 4949);
  expect_graph("3d/sphere_bignoise_vertex3.g2o", 2200, 8647);
  expect_graph("3d/torus3D.g2o", 5000, 9048);
  expect_graph("3d/parking-garage.g2o", 1661, 6275);
  expect_graph("3d/smallGrid3D.g2o", 125, 297);
  expect_graph("3d/tinyGrid3D.g2o", 9, 11);
  expect_graph("outliers/B25b_0.000.g2o", 8358, 8803);
  expect_graph("outliers/Bovisa06_odometry_bow_tr.g2o", 10744, 10962);
}

TEST(G2oFiles, AllRead) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(kData + "/g2o"))
    if (entry.path().extension() == ".g2o") {
      const auto graph = read_g2o(entry.path().string());
      EXPECT_TRUE(graph) << graph.error();
    }
}

TEST(BalFiles, HaveTheCountsOfTheirDescription) {
  const auto expect = [](const std::string& file, std::size_t cameras, std::size_t points, std::size_t observations) {
    const auto problem = read_bal(kData + "/bal/" + file);
    ASSERT_TRUE(problem) << problem.error();
    EXPECT_EQ(problem->cameras.size(), cameras);
    EXPECT_EQ(problem->points.size(), points);
    EXPECT_EQ(problem->observations.size(), observations);
  };
  expect("problem-49-7776-pre.txt", 49, 7776, 31843);
  expect("problem-21-11315-pre.txt", 21, 11315, 36455);
  expect("dubrovnik-3-7-pre.txt", 3, 7, 19);
}

TEST(EurocFolders, HaveTheCountsOfTheirDescription) {
  const auto expect = [](const std::string& folder, std::size_t imu, std::size_t frames, std::size_t rows,
                         std::size_t stereo) {
    const auto recording = read_euroc(kData + "/vio/" + folder);
    ASSERT_TRUE(recording) << recording.error();
    EXPECT_EQ(recording->imu.size(), imu);
    EXPECT_EQ(recording->frames.size(), frames);
    EXPECT_EQ(recording->observations.size(), rows);
    std::size_t right = 0;
    for (const auto& o : recording->observations) right += o.has_right;
    EXPECT_EQ(right, stereo);
    EXPECT_EQ(recording->cameras.size(), 2u);
    EXPECT_FALSE(recording->groundtruth.empty());
  };
  expect("euroc_v101_keyframes", 29120, 100, 23926, 19608);
  expect("euroc_mh01_first10s", 1998, 200, 24000, 11819);
}

}  // namespace
}  // namespace oriel
