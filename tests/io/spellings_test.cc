// One random problem written in every spelling by code of its own (Eigen), read back: the same graph, the same cost.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "oriel/io/problem.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

class Writer {
 public:
  explicit Writer(unsigned seed) : random_(seed) {}
  double normal(double sigma = 1.0) { return sigma * normal_(random_); }
  int index(int count) { return static_cast<int>(random_() % static_cast<unsigned>(count)); }
  Eigen::MatrixXd information(int n) {
    Eigen::MatrixXd a(n, n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) a(i, j) = normal() + 3 * (i == j);
    return a.transpose() * a;
  }

 private:
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

std::string number(double x) {
  char text[40];
  std::snprintf(text, sizeof text, " %.17g", x);
  return text;
}
template <class... X>
std::string numbers(X... x) {
  return (number(x) + ...);
}
std::string upper(const Eigen::MatrixXd& a) {
  std::string text;
  for (int i = 0; i < a.rows(); ++i)
    for (int j = i; j < a.cols(); ++j) text += number(a(i, j));
  return text + "\n";
}
std::string root(const Eigen::MatrixXd& a) { return upper(Eigen::MatrixXd(a.llt().matrixU())); }
std::string covariance(const Eigen::MatrixXd& a) { return upper(Eigen::MatrixXd(a.inverse())); }
std::string toro_order(const Eigen::MatrixXd& a) {
  return numbers(a(0, 0), a(0, 1), a(1, 1), a(2, 2), a(0, 2), a(1, 2)) + "\n";
}
std::string ids(const char* tag, int a) { return std::string(tag) + " " + std::to_string(a); }
std::string ids(const char* tag, int a, int b) { return ids(tag, a) + " " + std::to_string(b); }

double cost_of(const std::string& text, IsamNoise noise = IsamNoise::information) {
  PoseGraphReading reading;
  reading.isam_noise = noise;
  const auto file = parse_g2o(text, "f", reading);
  EXPECT_TRUE(file) << file.error();
  if (!file) return NAN;
  Graph graph;
  EXPECT_TRUE(file->is_3d ? add_pose_graph3(graph, *file, {}).ok() : add_pose_graph2(graph, *file, {}).ok());
  NativeEngine engine(graph);
  SolveOptions options;
  options.max_iterations = 0;
  return engine.solve(options).initial_cost;
}

void expect_same(double a, double b) {
  EXPECT_GT(a, 1.0);
  EXPECT_NEAR(a, b, 1e-9 * a);
}

// 30 poses in a chain with loops either way round, 7 landmarks from pose id 100 on.
struct Planar {
  std::string g2o_poses, g2o_landmarks, g2o_edges, g2o_sightings, toro, isam, isam_root, isam_covariance;

  explicit Planar(unsigned seed) {
    Writer w(seed);
    for (int i = 0; i < 30; ++i) {
      const std::string pose = numbers(w.normal(5), w.normal(5), w.normal(2)) + "\n";
      g2o_poses += ids("VERTEX_SE2", i) + pose;
      toro += ids("VERTEX2", i) + pose;
    }
    for (int k = 0; k < 60; ++k) {
      const int from = k < 29 ? k : w.index(30), to = k < 29 ? k + 1 : (from + 3 + w.index(20)) % 30;
      const std::string motion = numbers(w.normal(), w.normal(), w.normal());
      const auto omega = w.information(3);
      g2o_edges += ids("EDGE_SE2", from, to) + motion + upper(omega);
      toro += ids("EDGE2", from, to) + motion + toro_order(omega);
      const std::string isam_line = ids(k % 2 ? "EDGE2" : "ODOMETRY", from, to) + motion;
      isam += isam_line + upper(omega);
      isam_root += isam_line + root(omega);
      isam_covariance += isam_line + covariance(omega);
    }
    for (int l = 0; l < 7; ++l) g2o_landmarks += ids("VERTEX_XY", 100 + l) + numbers(w.normal(5), w.normal(5)) + "\n";
    for (int k = 0; k < 40; ++k) {
      const int pose = w.index(30), l = k < 7 ? k : w.index(7);
      const std::string place = numbers(w.normal(3), w.normal(3));
      const auto omega = w.information(2);
      g2o_sightings += ids("EDGE_SE2_XY", pose, 100 + l) + place + upper(omega);
      isam += ids("LANDMARK", pose, l) + place + upper(omega);  // ids of its own: these are poses too
      isam_root += ids("LANDMARK", pose, l) + place + root(omega);
      isam_covariance += ids("LANDMARK", pose, l) + place + covariance(omega);
    }
  }
};

struct Spatial {
  std::string g2o_poses, g2o_edges, g2o_sightings, toro, isam, isam_root;

  static std::string quaternion(const double* e) {
    const Eigen::Quaterniond q(Eigen::AngleAxisd(e[2], Eigen::Vector3d::UnitZ()) *
                               Eigen::AngleAxisd(e[1], Eigen::Vector3d::UnitY()) *
                               Eigen::AngleAxisd(e[0], Eigen::Vector3d::UnitX()));
    return numbers(q.x(), q.y(), q.z(), q.w());
  }
  explicit Spatial(unsigned seed) {
    Writer w(seed);
    Eigen::MatrixXd half = Eigen::MatrixXd::Identity(6, 6);
    for (int i = 3; i < 6; ++i) half(i, i) = 2;  // the vector part of a quaternion is half the angle
    for (int i = 0; i < 20; ++i) {
      const std::string place = numbers(w.normal(5), w.normal(5), w.normal(5));
      const double euler[] = {w.normal(), w.normal(0.5), w.normal()};
      g2o_poses += ids("VERTEX_SE3:QUAT", i) + place + quaternion(euler) + "\n";
      toro += ids("VERTEX3", i) + place + numbers(euler[0], euler[1], euler[2]) + "\n";
    }
    for (int k = 0; k < 40; ++k) {
      const int from = k < 19 ? k : w.index(20), to = k < 19 ? k + 1 : (from + 2 + w.index(15)) % 20;
      const std::string motion = numbers(w.normal(), w.normal(), w.normal());
      const double euler[] = {w.normal(), w.normal(0.5), w.normal()};
      const auto omega = w.information(6);
      const std::string angles = numbers(euler[0], euler[1], euler[2]);
      g2o_edges += ids("EDGE_SE3:QUAT", from, to) + motion + quaternion(euler) + upper(half * omega * half);
      toro += ids("EDGE3", from, to) + motion + angles + upper(omega);
      isam += ids("EDGE3", from, to) + motion + angles + upper(omega);
      isam_root += ids("EDGE3", from, to) + motion + angles + root(omega);
    }
    for (int k = 0; k < 15; ++k) {
      const int pose = w.index(20), l = k < 5 ? k : w.index(5);
      const std::string place = numbers(w.normal(3), w.normal(3), w.normal(3));
      const auto omega = w.information(3);
      g2o_sightings += ids("EDGE_SE3_TRACKXYZ", pose, 50 + l) + " 4" + place + upper(omega);
      isam += ids("POINT3", pose, l) + place + upper(omega);
      isam_root += ids("POINT3", pose, l) + place + root(omega);
    }
  }
};

TEST(Spellings, OfToroAndG2oCostTheSameInThePlaneAndInSpace) {
  for (unsigned seed = 1; seed < 6; ++seed) {
    const Planar planar(seed);
    expect_same(cost_of(planar.g2o_poses + planar.g2o_edges), cost_of(planar.toro));
    const Spatial spatial(seed);
    expect_same(cost_of(spatial.g2o_poses + spatial.g2o_edges), cost_of(spatial.toro));
  }
}

TEST(Spellings, OfIsamAndG2oCostTheSameWithLandmarksAndByEveryNoise) {
  for (unsigned seed = 1; seed < 6; ++seed) {
    const Planar planar(seed);
    const double cost = cost_of(planar.g2o_edges + planar.g2o_sightings);
    expect_same(cost, cost_of(planar.isam));
    expect_same(cost, cost_of(planar.isam_root, IsamNoise::root));
    expect_same(cost, cost_of(planar.isam_covariance, IsamNoise::covariance));
    const Spatial spatial(seed);
    const std::string offset = "PARAMS_SE3OFFSET 4 0 0 0 0 0 0 1\n";
    const double cost3 = cost_of(spatial.g2o_edges + spatial.g2o_sightings + offset);
    expect_same(cost3, cost_of(spatial.isam));
    expect_same(cost3, cost_of(spatial.isam_root, IsamNoise::root));
  }
}

TEST(Spellings, OfEdge2AloneAreToldByWhatIsInformation) {
  const auto toro = parse_g2o("EDGE2 0 1 1 0 0 50 0 50 100 0 0\n", "f");
  ASSERT_TRUE(toro) << toro.error();
  EXPECT_EQ(toro->spelling, PoseGraphSpelling::toro);
  EXPECT_EQ(information_matrix(toro->planar_edges[0])(2, 2), 100);
  const auto isam = parse_g2o("EDGE2 0 1 1 0 0 50 0 0 50 0 100\n", "f");
  ASSERT_TRUE(isam) << isam.error();
  EXPECT_EQ(isam->spelling, PoseGraphSpelling::isam);
  EXPECT_EQ(information_matrix(isam->planar_edges[0])(2, 2), 100);
}

TEST(Spellings, AreNotMixedInOneFile) {
  const auto error = [](const std::string& text) {
    const auto file = parse_g2o(text, "f");
    return file ? "no error" : file.error().text();
  };
  EXPECT_EQ(error("VERTEX_SE2 0 0 0 0\nEDGE2 0 1 1 0 0 50 0 0 50 0 100\n"),
            "f:2: expected a tag of g2o as in the lines before, found EDGE2");
  EXPECT_EQ(error("VERTEX2 0 0 0 0\nLANDMARK 0 1 1 0 1 0 1\n"),
            "f:2: expected a tag of TORO as in the lines before, found LANDMARK");
}

// What one writes and reads is what one had, in all that g2o's spelling can say.
TEST(Spellings, OfIsamAreWrittenAsG2oWithLandmarksThatHaveIdsOfTheirOwn) {
  const Planar planar(3);
  auto once = parse_g2o(planar.isam, "f");
  ASSERT_TRUE(once) << once.error();
  Graph graph;
  auto added = add_pose_graph2(graph, *once, {});
  ASSERT_TRUE(added);
  copy_values(graph, *added, *once);
  const auto twice = parse_g2o(format_g2o(*once), "g");
  ASSERT_TRUE(twice) << twice.error();
  EXPECT_EQ(twice->spelling, PoseGraphSpelling::g2o);
  ASSERT_EQ(twice->landmark_ids.size(), 7u);
  EXPECT_EQ(twice->landmark_ids.front(), 30) << "after the last pose";
  EXPECT_EQ(once->planar_landmarks, twice->planar_landmarks);
  ASSERT_EQ(once->planar_sightings.size(), twice->planar_sightings.size());
  for (std::size_t k = 0; k < twice->planar_sightings.size(); ++k) {
    EXPECT_EQ(once->planar_sightings[k].landmark, twice->planar_sightings[k].landmark);
    EXPECT_EQ(once->planar_sightings[k].information, twice->planar_sightings[k].information);
  }
  expect_same(cost_of(planar.isam), cost_of(format_g2o(*once)));
}

}  // namespace
}  // namespace oriel
