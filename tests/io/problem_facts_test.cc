#include "oriel/io/problem_facts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace oriel {
namespace {

std::size_t count_of(const std::vector<ProblemFacts::Count>& counts, const std::string& what) {
  for (const auto& c : counts)
    if (c.what == what) return c.count;
  return 0;
}

ProblemFacts facts_of_text(const std::string& text) {
  PoseGraphReading reading;
  reading.project_information = true;
  const auto file = parse_g2o(text, "f", reading);
  EXPECT_TRUE(file) << file.error();
  return facts_of(*file);
}

// Two pieces: poses 0, 1, 2 with landmark 50, and poses 7, 8 with a FIX; pose 9 hangs on nothing.
const std::string kTwoPieces =
    "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\nVERTEX_SE2 7 0 5 0\nVERTEX_SE2 8 1 5 0\n"
    "VERTEX_SE2 9 0 9 0\nVERTEX_XY 50 1 1\n"
    "EDGE_SE2 0 1 1 0 0 100 0 0 100 0 100\n"   // line 8
    "EDGE_SE2 1 2 1 0 0 100 0 0 100 0 100\n"   // 9
    "EDGE_SE2 2 0 -2 3 0 100 0 0 100 0 100\n"  // 10: 3 m off at 0.1 m
    "EDGE_SE2 1 0 -1 0 0 100 0 0 100 0 100\n"  // 11: line 8 again, the other way round
    "EDGE_SE2 1 1 0 0 0 1 0 0 1 0 1\n"         // 12
    "EDGE_SE2 7 8 1 0 0 100 0 0 -1 0 100\n"    // 13
    "EDGE_SE2_XY 1 50 0 1.05 100 0 100\n"      // 14
    "FIX 8\n";

TEST(ProblemFacts, CountTypesDegreesAndPieces) {
  const ProblemFacts f = facts_of_text(kTwoPieces);
  EXPECT_EQ(count_of(f.counts, "poses"), 6u);
  EXPECT_EQ(count_of(f.counts, "landmarks"), 1u);
  EXPECT_EQ(count_of(f.counts, "edges between poses that follow one another"), 4u);
  EXPECT_EQ(count_of(f.counts, "edges that close loops"), 1u);
  EXPECT_EQ(count_of(f.counts, "sightings of landmarks"), 1u);
  EXPECT_EQ(count_of(f.counts, "poses held by FIX"), 1u);
  EXPECT_EQ(f.poses_alone, 1u);
  EXPECT_EQ(f.landmarks_once, 1u);
  EXPECT_EQ(f.pose_degree.least, 0u);
  EXPECT_EQ(f.pose_degree.most, 4u);
  EXPECT_DOUBLE_EQ(f.pose_degree.mean, 11.0 / 6.0);
  ASSERT_EQ(f.components.size(), 3u);
  EXPECT_EQ(f.components[0].poses, 3u);
  EXPECT_EQ(f.components[0].landmarks, 1u);
  EXPECT_EQ(f.components[0].first, "pose 0");
  EXPECT_EQ(f.components[0].free, "translation and rotation (3)");
  EXPECT_EQ(f.components[1].first, "pose 7");
  EXPECT_EQ(f.components[1].free, "") << "FIX 8 holds it";
  EXPECT_EQ(f.components[2].first, "pose 9");
}

TEST(ProblemFacts, NameTheLinesThatLookWrong) {
  const ProblemFacts f = facts_of_text(kTwoPieces);
  for (const char* kind : {"self", "repeated", "indefinite", "far"})
    EXPECT_EQ(count_of(f.suspicious, kind), 1u) << kind;
  ASSERT_EQ(f.examples.size(), 4u);
  const auto text = [](const ProblemFacts::Suspicion& e) { return std::to_string(e.line) + ": " + e.what; };
  EXPECT_EQ(f.examples[0].line, 12) << "self";
  EXPECT_EQ(f.examples[1].line, 13) << "indefinite";
  EXPECT_EQ(text(f.examples[2]), "11: EDGE_SE2 1 0");
  EXPECT_EQ(text(f.examples[3]), "10: EDGE_SE2 2 0");
  EXPECT_NEAR(f.examples[3].sigmas, 30.0, 1e-9);
  EXPECT_EQ(f.start, "file");
  EXPECT_NEAR(f.cost, 0.5 * (900.0 + 0.25), 1e-9) << "half of the squares: 30 sigmas, and half a sigma at the landmark";
  EXPECT_EQ(f.edges, 6u);
}

TEST(ProblemFacts, OfAFileWithoutValuesAreTakenAtChainedOdometry) {
  const std::string edge = " 100 0 0 100 0 100\n";
  const ProblemFacts f =
      facts_of_text("EDGE_SE2 0 1 1 0 0" + edge + "EDGE_SE2 1 2 1 0 0" + edge + "EDGE_SE2 2 0 -2 0.2 0" + edge);
  EXPECT_EQ(f.start, "odometry");
  EXPECT_NEAR(f.cost, 0.5 * 4.0, 1e-9);
  EXPECT_TRUE(f.suspicious.empty()) << "two sigmas are nothing";
}

TEST(ProblemFacts, OfLandmarksThatAreHeldSayWhatTurnsAboutThem) {
  const std::string start =
      "VERTEX_SE2 0 0 0 0\nVERTEX_XY 5 1 1\nVERTEX_XY 6 2 1\nEDGE_SE2_XY 0 5 1 1 1 0 1\n"
      "EDGE_SE2_XY 0 6 2 1 1 0 1\n";
  EXPECT_EQ(facts_of_text(start + "FIX 5\n").components[0].free, "rotation about what FIX holds");
  EXPECT_EQ(facts_of_text(start + "FIX 5 6\n").components[0].free, "");
}

TEST(ProblemFacts, OfABundleAdjustmentCountSightsAndWhatLiesBehind) {
  const auto file = parse_bal(
      "2 2 4\n0 0 -10 0\n0 0 -10 0\n1 0 0 0\n1 1 0 200\n"
      "0 0 0 0 0 0 100 0 0\n0 0 0 1 0 0 100 0 0\n-1 0 -10\n5 0 10\n",
      "f");
  ASSERT_TRUE(file) << file.error();
  const ProblemFacts f = facts_of(*file);
  EXPECT_EQ(count_of(f.counts, "observations of points behind their camera"), 1u);
  EXPECT_EQ(count_of(f.suspicious, "repeated"), 1u);
  EXPECT_EQ(count_of(f.suspicious, "far"), 1u);
  EXPECT_EQ(f.landmarks_once, 1u);
  EXPECT_EQ(f.components[0].free, "translation, rotation and scale (7)");
  EXPECT_EQ(f.components[0].first, "camera 0");
  EXPECT_EQ(f.examples.back().what, "observation camera 1 point 1");
}

}  // namespace
}  // namespace oriel
