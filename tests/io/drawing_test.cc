#include "oriel/io/drawing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <sstream>
#include <string>

namespace oriel {
namespace {

std::size_t count(const std::string& text, const std::string& word) {
  std::size_t n = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

const std::string kSquare =
    "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 10 0 0\nVERTEX_SE2 2 10 10 0\nVERTEX_SE2 3 0 10 0\nVERTEX_XY 9 5 5\n"
    "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 2 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 2 3 1 0 0 1 0 0 1 0 1\n"
    "EDGE_SE2 3 0 1 0 0 1 0 0 1 0 1\nEDGE_SE2_XY 0 9 5 5 1 0 1\n";

TEST(Drawing, TellsThePathFromTheLoops) {
  const Drawing d = drawing_of(*parse_g2o(kSquare, "f"));
  EXPECT_EQ(d.path, (std::vector<Drawing::Line>{{0, 1}, {2, 1}, {2, 3}}));
  EXPECT_EQ(d.loops, (std::vector<Drawing::Line>{{3, 0}}));
  EXPECT_EQ(d.landmarks, (std::vector<Vec3d>{{5, 5, 0}}));
}

// A camera at (1, 2, 3) that is turned by a quarter about z.
TEST(Drawing, OfABundleAdjustmentShowsTheCentresOfCameras) {
  const double quarter = std::acos(0.0);
  BalFile file;
  file.cameras.push_back({0, 0, quarter, 2, -1, -3, 500, 0, 0});  // t = -R c
  file.points.push_back({7, 8, 9});
  const Drawing d = drawing_of(file);
  EXPECT_LT((d.poses[0] - Vec3d{1, 2, 3}).norm(), 1e-14);
  EXPECT_EQ(d.landmarks[0], (Vec3d{7, 8, 9}));
}

// Read back by the words of its own header.
TEST(Ply, HasAsManyVerticesAndEdgesAsItsHeaderSays) {
  const Drawing d = drawing_of(*parse_g2o(kSquare, "f"));
  std::istringstream in(format_ply(d));
  std::string line, word;
  std::getline(in, line);
  EXPECT_EQ(line, "ply");
  std::size_t vertices = 0, edges = 0;
  while (std::getline(in, line) && line != "end_header") {
    std::istringstream words(line);
    words >> word;
    if (word != "element") continue;
    std::size_t n;
    words >> word >> n;
    (word == "vertex" ? vertices : edges) = n;
  }
  EXPECT_EQ(vertices, 5u);
  EXPECT_EQ(edges, 4u);
  std::vector<Vec3d> places;
  for (std::size_t i = 0; i < vertices; ++i) {
    double x, y, z;
    int r, g, b;
    ASSERT_TRUE(in >> x >> y >> z >> r >> g >> b);
    places.push_back({x, y, z});
  }
  EXPECT_EQ(places[0], d.landmarks[0]);
  EXPECT_EQ(places[3], d.poses[2]);
  for (std::size_t i = 0; i < edges; ++i) {
    std::size_t a, b;
    ASSERT_TRUE(in >> a >> b);
    EXPECT_LT(std::max(a, b), vertices);
    EXPECT_EQ((places[a] - places[b]).norm(), 10);
  }
  EXPECT_FALSE(in >> word) << "nothing comes after";
}

TEST(Svg, FitsEachPanelAndDrawsPathLoopsAndLandmarksInBoth) {
  const Drawing d = drawing_of(*parse_g2o(kSquare, "f"));
  Drawing far = d;
  for (Vec3d& p : far.poses) p = p * 100.0;
  const std::string svg = format_svg("a <b> & c", d, far);
  EXPECT_EQ(count(svg, "<svg "), 1u);
  EXPECT_EQ(count(svg, "</svg>"), 1u);
  EXPECT_NE(svg.find("a &lt;b&gt; &amp; c"), std::string::npos);
  EXPECT_EQ(count(svg, "#1e50c8"), 2u);
  EXPECT_EQ(count(svg, "#999"), 2u);
  EXPECT_EQ(count(svg, "#c87814"), 2u);
  EXPECT_NE(svg.find("d=\"M24 620L576 620M576 68L576 620M576 68L24 68\""), std::string::npos) << svg;
  EXPECT_NE(svg.find("d=\"M624 620L1176 620M1176 68L1176 620M1176 68L624 68\""), std::string::npos) << svg;
  EXPECT_NE(svg.find(">5 m<"), std::string::npos);
  EXPECT_NE(svg.find(">500 m<"), std::string::npos);
  EXPECT_NE(svg.find("x to the right, y up"), std::string::npos);
}

TEST(Svg, LooksAtSpaceFromWhereTheMapIsWidest) {
  Drawing d;
  d.poses = {{0, 0, 0}, {0.1, 5, 9}};
  d.path = {{0, 1}};
  EXPECT_NE(format_svg("", d, d).find("y to the right, z up"), std::string::npos);
}

TEST(Svg, LeavesOutWhatIsNoNumberAndThinsWhatIsTooMuchAndSaysSo) {
  Drawing d;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i < 50000; ++i) d.landmarks.push_back({i % 7 == 0 ? nan : std::cos(i), std::sin(i), 1e300});
  d.poses = {{nan, nan, nan}, {0, 0, 0}, {1, 1, 0}};
  d.path = {{0, 1}, {1, 2}};
  const std::string svg = format_svg("t", d, d);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
  EXPECT_NE(svg.find("one in 3 of 50000 landmarks"), std::string::npos);
  EXPECT_LT(svg.size(), 1'500'000u);
  EXPECT_NE(format_svg("t", Drawing(), Drawing()).find("</svg>"), std::string::npos) << "nothing to draw is fine";
}

}  // namespace
}  // namespace oriel
