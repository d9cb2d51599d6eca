// Landmarks in g2o files: where they begin, what holds them, what is refused, and that they are found again.
#include "oriel/io/landmarks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "oriel/io/problem.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

std::string error_of(const std::string& text) {
  const auto graph = parse_g2o(text, "f.g2o");
  return graph ? "no error" : graph.error().text();
}

const std::string kPlanar =
    "EDGE_SE2_XY 3 8 1 0 4 0 4\n"
    "VERTEX_XY 8 5 5\n"
    "VERTEX_SE2 3 0 0 1.5707963267948966\n"
    "EDGE_BEARING_SE2_XY 3 9 0.25 10\n"
    "VERTEX_XY 9 7 7 # a tree\n"
    "FIX 3 9\n";

TEST(Landmarks, AreReadInAnyOrderWithTheIdsTheyShareWithPoses) {
  const auto g = parse_g2o(kPlanar, "f.g2o");
  ASSERT_TRUE(g) << g.error();
  EXPECT_EQ(g->ids, (std::vector<std::int64_t>{3}));
  EXPECT_EQ(g->landmark_ids, (std::vector<std::int64_t>{8, 9}));
  EXPECT_EQ(g->planar_landmarks[1], (Vec2d{7, 7}));
  ASSERT_EQ(g->planar_sightings.size(), 1u);
  EXPECT_EQ(g->planar_sightings[0].pose, 0);
  EXPECT_EQ(g->planar_sightings[0].landmark, 0);
  EXPECT_EQ(g->planar_sightings[0].information, (std::array<double, 3>{4, 0, 4}));
  ASSERT_EQ(g->planar_bearings.size(), 1u);
  EXPECT_EQ(g->planar_bearings[0].measurement, 0.25);
  EXPECT_EQ(g->fixed, (std::vector<std::int32_t>{0}));
  EXPECT_EQ(g->fixed_landmarks, (std::vector<std::int32_t>{1}));
  const auto twice = parse_g2o(format_g2o(*g), "g.g2o");
  ASSERT_TRUE(twice) << twice.error();
  EXPECT_EQ(format_g2o(*twice), format_g2o(*g));
}

TEST(Landmarks, ComeFromTheirSightingsWhereNoVertexLineIs) {
  const auto g = parse_g2o("EDGE_SE2 3 4 1 0 0 1 0 0 1 0 1\nEDGE_SE2_XY 4 8 2 1 4 0 4\n", "f.g2o");
  ASSERT_TRUE(g) << g.error();
  EXPECT_EQ(g->landmark_ids, (std::vector<std::int64_t>{8}));
  const auto places = place_landmarks2(*g, {Pose2d{}, Pose2d{Rot2d::exp(std::acos(0.0)), {{1, 0}}}});
  EXPECT_LT((places[0].p - Vec2d{0, 2}).norm(), 1e-14);
}

TEST(Landmarks, KnownByBearingsBeginWhereTheseMeet) {
  const auto g = parse_g2o(
      "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_BEARING_SE2_XY 0 8 0.4636476090008061 1\n"
      "EDGE_BEARING_SE2_XY 1 8 0.7853981633974483 1\nEDGE_BEARING_SE2_XY 1 9 0 1\n",
      "f.g2o");
  ASSERT_TRUE(g) << g.error();
  const auto places = place_landmarks2(*g, {Pose2d{}, Pose2d{Rot2d{}, {{1, 0}}}});
  EXPECT_LT((places[0].p - Vec2d{2, 1}).norm(), 1e-12);
  EXPECT_LT((places[1].p - Vec2d{2, 0}).norm(), 1e-12) << "1 m along its only bearing";
}

TEST(Landmarks, OfBadFilesAreNamed) {
  EXPECT_EQ(error_of(kPlanar + "EDGE_SE2_XY 3 7 1 0 4 0 4\n"), "f.g2o:7: no VERTEX line has the id 7");
  EXPECT_EQ(error_of(kPlanar + "EDGE_SE2_XY 8 3 1 0 4 0 4\n"),
            "f.g2o:7: expected a pose with the id 8, found that it is none");
  EXPECT_EQ(error_of(kPlanar + "VERTEX_SE2 9 0 0 0\n"), "f.g2o:7: the id 9 is a pose's and a landmark's");
  EXPECT_EQ(error_of(kPlanar + "VERTEX_XY 9 0 0\n"),
            "f.g2o:7: expected each landmark once, found the id 9 again (first in line 5)");
  EXPECT_EQ(error_of(kPlanar + "EDGE_SE2_XY 3 8 1 0 4 0\n"),
            "f.g2o:7: EDGE_SE2_XY: expected a finite number for I22, found the end of the line");
  EXPECT_EQ(error_of(kPlanar + "EDGE_SE2_XY 3 8 1 0 1 5 1\n"),
            "f.g2o:7: EDGE_SE2_XY 3 8: expected positive semidefinite information, found a negative eigenvalue");
  EXPECT_EQ(error_of("VERTEX_XY 9 0 0\n"), "f.g2o: expected poses, found landmarks alone");
  EXPECT_EQ(error_of("EDGE_SE2_XY 3 3 1 0 4 0 4\n"), "f.g2o: the id 3 is a pose's and a landmark's");
  const std::string spatial = "EDGE_SE3_TRACKXYZ 0 1 2 1 2 3 1 0 0 1 0 1\n";
  EXPECT_EQ(error_of(spatial), "f.g2o:1: no PARAMS_SE3OFFSET line has the id 2");
  const std::string offset = "PARAMS_SE3OFFSET 2 0 0 0 0 0 0 1\n";
  EXPECT_EQ(error_of(spatial + offset), "no error");
  EXPECT_EQ(error_of(spatial + offset + offset),
            "f.g2o:3: expected each PARAMS_SE3OFFSET once, found the id 2 again (first in line 2)");
}

// The truth is found from the file's own start and from sightings, whatever the sensor's place on the body.
TEST(Landmarks, OfASensorBesideTheBodyAreFoundAgain) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  const auto vector = [&](double sigma) {
    return Vec3d{sigma * normal(random), sigma * normal(random), sigma * normal(random)};
  };
  PoseGraphFile file;
  file.is_3d = true;
  const Pose3d sensor{Rot3d::exp({{0.3, -0.2, 1.0}}), {{0.5, 0.1, 2.0}}};
  file.offsets.push_back({7, {sensor.t, sensor.R.qx, sensor.R.qy, sensor.R.qz, sensor.R.qw}, 0});
  std::vector<Pose3d> poses;
  std::vector<Vec3d> landmarks;
  for (int i = 0; i < 6; ++i) poses.push_back({Rot3d::exp(vector(1.0)), vector(4.0)}), file.ids.push_back(i);
  for (int l = 0; l < 8; ++l) landmarks.push_back(vector(5.0)), file.landmark_ids.push_back(10 + l);
  for (int i = 0; i + 1 < 6; ++i) {
    const Pose3d m = poses[i].inverse() * poses[i + 1];
    auto& e = file.spatial_edges.emplace_back();
    e.from = i, e.to = i + 1, e.measurement = {m.t + vector(0.3), m.R.qx, m.R.qy, m.R.qz, m.R.qw};
    for (int k : {0, 6, 11, 15, 18, 20}) e.information[k] = 1e-4;  // the sightings decide
  }
  for (int i = 0; i < 6; ++i)
    for (int l = 0; l < 8; ++l) {
      auto& s = file.spatial_sightings.emplace_back();
      s.pose = i, s.landmark = l, s.measurement = sensor.inverse() * (poses[i].inverse() * landmarks[l]);
      s.information = {100, 0, 0, 100, 0, 100};
    }
  const auto read = parse_g2o(format_g2o(file), "f.g2o");
  ASSERT_TRUE(read) << read.error();
  Graph graph;
  const auto ids = add_pose_graph3(graph, *read, {});
  ASSERT_TRUE(ids) << ids.error();
  NativeEngine engine(graph);
  EXPECT_TRUE(engine.solve({}).converged());
  const Pose3d to_truth = poses[0] * graph.value(ids->poses[0]).inverse();
  for (int l = 0; l < 8; ++l) EXPECT_LT((to_truth * graph.value(ids->landmarks[l]).p - landmarks[l]).norm(), 1e-3) << l;
}

}  // namespace
}  // namespace oriel
