#include "oriel/io/g2o.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "oriel/io/problem_format.h"

namespace oriel {
namespace {

const std::string kPlanar =
    "# a square\n"
    "EDGE_SE2 7 3 1 0 1.5 100 0 0 100 0 400\n"
    "\n"
    "VERTEX_SE2 7 1 2 0.5\n"
    "VERTEX_SE2 3 0 0 -1.07e+001\n"
    "EDGE_SE2 3 7 1 0 1.5 1 0 0 1 0 0\n"
    "EDGE_SE2 3 7 1 0 1.5 1 0 0 1 0 0\n"
    "EDGE_SE2 3 3 0 0 0 1 0 0 1 0 1\n"
    "FIX 3\n";

std::string error_of(const std::string& text) {
  const auto graph = parse_g2o(text, "f.g2o");
  return graph ? "no error" : graph.error().text();
}

std::string spatial_edge(const std::string& quaternion, double last = 1) {
  std::string text = "EDGE_SE3:QUAT 0 1 1 2 3 " + quaternion;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) text.append(" ").append(std::to_string(i != j ? 0.0 : i == 5 ? last : 1.0));
  return text + "\n";
}

TEST(G2o, ReadsVerticesAndEdgesInAnyOrder) {
  const auto graph = parse_g2o(kPlanar, "f.g2o");
  ASSERT_TRUE(graph) << graph.error();
  EXPECT_FALSE(graph->is_3d);
  EXPECT_EQ(graph->ids, (std::vector<std::int64_t>{3, 7}));
  EXPECT_EQ(graph->pose_lines, (std::vector<std::int64_t>{5, 4}));
  EXPECT_EQ(graph->planar_poses[0], (Vec3d{0, 0, -10.7}));
  EXPECT_EQ(graph->fixed, (std::vector<std::int32_t>{0}));
  ASSERT_EQ(graph->planar_edges.size(), 3u) << "repeated pairs stay, the self-edge goes";
  EXPECT_EQ(graph->self_edges_left_out, 1);
  EXPECT_EQ(graph->planar_edges[0].from, 1);
  EXPECT_EQ(graph->planar_edges[0].to, 0);
  EXPECT_EQ(graph->planar_edges[0].line, 2);
  EXPECT_EQ(information_matrix(graph->planar_edges[0])(2, 2), 400);
}

TEST(G2o, TakesPosesFromEdgesOnlyWhereNoVertexLineIs) {
  const auto graph =
      parse_g2o("EDGE_SE2 9 4 1 0 0 1 0 0 1 0 1\nEDGE_SE2 4 12345678901234 1 0 0 1 0 0 1 0 1\n", "f.g2o");
  ASSERT_TRUE(graph) << graph.error();
  EXPECT_FALSE(graph->has_vertices);
  EXPECT_EQ(graph->ids, (std::vector<std::int64_t>{4, 9, 12345678901234}));
  EXPECT_EQ(graph->planar_edges[1].to, 2);
  EXPECT_EQ(error_of("VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"), "f.g2o:2: no VERTEX line has the id 1");
}

TEST(G2o, NormalisesQuaternions) {
  const auto graph = parse_g2o(
      "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 2\nVERTEX_SE3:QUAT 1 1 2 3 0 0.6000001 0 0.8\n" + spatial_edge("0 0 0 1"),
      "f.g2o");
  ASSERT_TRUE(graph) << graph.error();
  EXPECT_TRUE(graph->is_3d);
  EXPECT_EQ(graph->spatial_poses[0].qw, 1);
  const auto& q = graph->spatial_poses[1];
  EXPECT_NEAR(q.qx * q.qx + q.qy * q.qy + q.qz * q.qz + q.qw * q.qw, 1, 1e-15);
}

TEST(G2o, NamesFileLineAndExpectationForBadInput) {
  const std::string start = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 0 0\n";
  const auto with = [&](const std::string& line) { return error_of(start + line); };
  EXPECT_EQ(with("EDGE_SE2 0 1 1.0 2.0\n"),
            "f.g2o:3: EDGE_SE2: expected a finite number for theta, found the end of the line");
  EXPECT_EQ(with("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1 5\n"), "f.g2o:3: EDGE_SE2: expected the end of the line, found '5'");
  EXPECT_EQ(with("EDGE_SE2 0 1 nan 0 0 1 0 0 1 0 1\n"),
            "f.g2o:3: EDGE_SE2: expected a finite number for x, found 'nan'");
  EXPECT_EQ(with("EDGE_SE2 0 1 1 inf 0 1 0 0 1 0 1\n"),
            "f.g2o:3: EDGE_SE2: expected a finite number for y, found 'inf'");
  EXPECT_EQ(with("EDGE_SE2 0 1 1 abc 0 1 0 0 1 0 1\n"),
            "f.g2o:3: EDGE_SE2: expected a finite number for y, found 'abc'");
  EXPECT_EQ(with("EDGE_SE2 0 -4 1 0 0 1 0 0 1 0 1\n"),
            "f.g2o:3: EDGE_SE2: expected an id of 0 or more for to, found -4");
  EXPECT_EQ(with("EDGE_SE2 0 99999999999999999999999 1 0 0 1 0 0 1 0 1\n"),
            "f.g2o:3: EDGE_SE2: expected an id for to, found '99999999999999999999999', which is out of range");
  EXPECT_EQ(with("VERTEX_SE2 0 5 5 5\n"), "f.g2o:3: expected each pose once, found the id 0 again (first in line 1)");
  EXPECT_EQ(with("FIX 8\n"), "f.g2o:3: FIX: no pose has the id 8");
  EXPECT_EQ(with(spatial_edge("0 0 0 1")), "f.g2o:3: expected SE2 as in the lines before, found EDGE_SE3:QUAT");
  EXPECT_EQ(
      with("VERTEX_NOPE 0 1 2 3\n"),
      "f.g2o:3: expected a tag of g2o (VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT, FIX, ...), TORO or iSAM, "
      "found 'VERTEX_NOPE'");
  EXPECT_EQ(error_of(spatial_edge("0 0 0 0")), "f.g2o:1: EDGE_SE3:QUAT: expected a quaternion that is not zero");
  EXPECT_EQ(error_of(""), "f.g2o: expected VERTEX or EDGE lines, found none (is the file empty?)");
  std::string long_line = "EDGE_SE2 ";
  long_line.append(10'000'000, '1').append("\n");
  EXPECT_LT(error_of(long_line).size(), 200u);
}

// V5
TEST(G2o, RefusesIndefiniteInformationAndTakesSemidefinite) {
  EXPECT_EQ(error_of("EDGE_SE2 0 1 1 0 0 -500 0 0 1 0 1\n"),
            "f.g2o:1: EDGE_SE2 0 1: expected positive semidefinite information, found a negative eigenvalue");
  EXPECT_NE(error_of("EDGE_SE2 0 1 1 0 0 1 2 0 1 0 1\n"), "no error") << "eigenvalues 3, -1";
  EXPECT_NE(error_of("EDGE_SE2 0 1 1 0 0 0 1 0 1 0 1\n"), "no error") << "zero diagonal, row not zero";
  EXPECT_NE(error_of("EDGE_SE2 0 1 1 0 0 1e-300 1e300 0 1 0 1\n"), "no error") << "no overflow hides it";
  EXPECT_EQ(error_of("EDGE_SE2 0 1 1 0 0 0 0 0 0 0 0\n"), "no error");
  EXPECT_EQ(error_of("EDGE_SE2 0 1 1 0 0 1 2 0 4 0 1\n"), "no error") << "rank 2";
  EXPECT_EQ(error_of(spatial_edge("0 0 0 1", 0)), "no error");
  EXPECT_NE(error_of(spatial_edge("0 0 0 1", -1)), "no error");
}

TEST(G2o, ReadsBackWhatItWrote) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::string text;
  for (int i = 0; i < 5; ++i) {
    text += "VERTEX_SE3:QUAT " + std::to_string(3 * i);
    for (int k = 0; k < 7; ++k) text.append(" ").append(std::to_string(normal(random)));
    text += "\n";
  }
  const auto once =
      parse_g2o(text + "FIX 0 6\nEDGE_SE3:QUAT 0 12" + spatial_edge("0.1 0.2 0.3 0.9").substr(17), "f.g2o");
  ASSERT_TRUE(once) << once.error();
  EXPECT_EQ(once->fixed, (std::vector<std::int32_t>{0, 2}));
  const auto twice = parse_g2o(format_g2o(*once), "g.g2o");
  ASSERT_TRUE(twice) << twice.error();
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(once->spatial_poses[i].t, twice->spatial_poses[i].t);
    EXPECT_NEAR(once->spatial_poses[i].qw, twice->spatial_poses[i].qw, 1e-15)
        << "normalised again: the last bit may move";
  }
  EXPECT_EQ(once->spatial_edges[0].information, twice->spatial_edges[0].information);
  EXPECT_EQ(once->spatial_edges[0].to, 4);
}

TEST(G2o, SurvivesAnyBytes) {
  std::mt19937 random(11);
  for (int round = 0; round < 2000; ++round) {
    std::string text = round % 2 ? kPlanar : "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n" + spatial_edge("0 0 0 1");
    for (int k = 0; k < 1 + round % 5; ++k) text[random() % text.size()] = static_cast<char>(random());
    text.resize(random() % (text.size() + 1));
    const auto graph = parse_g2o(text, "f.g2o");
    if (!graph) {
      EXPECT_EQ(graph.error().text().find('\n'), std::string::npos);
      EXPECT_LT(graph.error().text().size(), 300u);
    }
  }
}

TEST(ProblemFormat, IsToldByContent) {
  EXPECT_EQ(detect_format(kPlanar, "f").value(), ProblemFormat::g2o);
  EXPECT_EQ(detect_format("\n3 7 19\n", "f").value(), ProblemFormat::bal);
  EXPECT_EQ(detect_format("", "f").error().text(), "f: expected a g2o or BAL problem, found an empty file");
  EXPECT_FALSE(detect_format("%!", "f"));
}

}  // namespace
}  // namespace oriel
