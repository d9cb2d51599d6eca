// Visual maps to text and back: the same bits, and one clear line for whatever is wrong.
#include "oriel/io/visual_map_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include "oriel/io/text.h"
#include "oriel/run/transfer.h"
#include "oriel/run/two_frame_odometry.h"
#include "window/simulated_flight.h"

namespace oriel {
namespace {

Bytes bytes(const VisualMap& map) {
  Bytes out;
  encode(map, out);
  return out;
}

// As an odometry leaves it, with frames of all kinds.
const VisualMap& flown_map() {
  static const VisualMap map = [] {
    const SimulatedFlight flight({.duration_s = 1.2, .points = 150});
    auto odometry = TwoFrameOdometry::start(ExecutorKind::in_place, flight.rig, {.pixel_sigma = 0.5}).value();
    for (std::size_t k = 0; k < flight.frames.size(); ++k) {
      std::vector<FeatureObservation> features = flight.frames[k].features;
      if (k == 4) features.resize(5);
      if (k >= 8)
        for (FeatureObservation& f : features) f.track = -f.track;
      EXPECT_TRUE(odometry.add({flight.frames[k].time, features}));
    }
    odometry.finish();
    return odometry.take_map();
  }();
  return map;
}

// Small enough to be spoilt line by line.
const std::string kSmall =
    "oriel-visual-map/1\n"
    "rigs 1\n"
    "500 500 320 240 0 0 0 0 1 0 0 0 1 0 0 0 1 0 0 0\n"
    "500 500 320 240 0 0 0 0 1 0 0 0 1 0 0 0 1 0.2 0 0  # right\n"
    "frames 2\n"
    "100 0 0 0 0 0 0 1 origin - 0 1 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0\n"
    "200 1 0 0 0 0 0 1 solved 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n"
    "points 1\n"
    "7 0.5 0 4 0 2 1 0 0 1 0 4\n"
    "observations 2\n"
    "0 7 1 1 380 240 355 240 1 0 1 1 0 1 0.5 0 4 1 0 0 1 0 4\n"
    "- 8 0 0 100 50 0 0 1 0 1 1 0 1 0 0 0 0 0 0 0 0 0\n"
    "end\n";

TEST(VisualMapFile, ComesBackWithTheSameBits) {
  const VisualMap& map = flown_map();
  EXPECT_GT(map.points.size(), 100u);
  const std::string path = testing::TempDir() + "oriel_visual_map.txt";
  ASSERT_TRUE(write_visual_map(path, map));
  const Result<VisualMap> back = read_visual_map(path);
  ASSERT_TRUE(back) << back.error();
  EXPECT_EQ(bytes(*back), bytes(map));
  EXPECT_EQ(format_visual_map(*back), *read_text_file(path));
  std::filesystem::remove(path);
}

TEST(VisualMapFile, KeepsAnEmptyMapAndEveryBitOfOddNumbers) {
  const auto empty = parse_visual_map(format_visual_map({}), "empty");
  ASSERT_TRUE(empty) << empty.error();
  EXPECT_EQ(empty->frames.size(), 0u);
  VisualMap map = *parse_visual_map(kSmall, "small");
  map.frames.time[0].ns = INT64_MIN;
  map.points.track[0] = map.observations.track[0] = INT64_MAX;
  map.points.p[0] = {{-0.0, 5e-324, -1.7976931348623157e308}};
  map.observations.pixel0[1] = {{0.1 + 0.2, 1.0 / 3.0}};
  const auto back = parse_visual_map(format_visual_map(map), "odd");
  ASSERT_TRUE(back) << back.error();
  EXPECT_EQ(bytes(*back), bytes(map));
}

std::string fault(const std::string& from, const std::string& to) {
  std::string text = kSmall;
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  const auto read = parse_visual_map(text, "map.txt");
  return read ? "" : read.error().text();
}

TEST(VisualMapFile, NamesFileAndLineOfWhatIsWrong) {
  ASSERT_TRUE(parse_visual_map(kSmall, "map.txt"));
  EXPECT_EQ(fault("map/1", "map/2"), "map.txt:1: expected oriel-visual-map/1, found 'oriel-visual-map/2'");
  EXPECT_EQ(fault("rigs 1", "rig 1"), "map.txt:2: expected rigs, found 'rig'");
  EXPECT_EQ(fault("0.2 0 0", "0.2 0"),
            "map.txt:4: expected a finite number for t_body_camera, found the end of the line");
  EXPECT_EQ(fault("0.2 0 0", "0.2 0 0 1"), "map.txt:4: expected the end of the line, found '1'");
  EXPECT_EQ(fault("frames 2", "frames 2000000000"),
            "map.txt:5: expected frames as many as there are lines, found 2000000000");
  EXPECT_EQ(fault("100 0 0 0", "1e2 0 0 0"), "map.txt:6: expected a whole number for the stamp, found '1e2'");
  EXPECT_EQ(fault("solved", "great"),
            "map.txt:7: expected one of pending, origin, solved, held, few, no_agreement, failed for the status, found "
            "'great'");
  EXPECT_EQ(fault("solved 0", "solved 1"), "map.txt:7: expected - or a row below 1 for the previous frame, found '1'");
  EXPECT_EQ(fault("7 0.5", "7 nan"), "map.txt:9: expected a finite number for the position, found 'nan'");
  EXPECT_EQ(fault("observations 2", "observations 1"),
            "map.txt:10: expected 2 observations, as the frames say, found 1");
  EXPECT_EQ(fault("0 7 1 1", "1 7 1 1"), "map.txt:11: expected - or a row below 1 for the point, found '1'");
  EXPECT_EQ(fault("0 7 1 1", "0 7 2 1"), "map.txt:11: expected 0 to 1 for whether the right camera saw it, found 2");
  EXPECT_EQ(fault("end\n", ""), "map.txt:12: expected end, found the end of the file");
  // What only the whole shows has the line of its row.
  EXPECT_EQ(fault("200 1", "100 1"), "map.txt:7: visual map: frame 1: expected a later stamp than the frame before");
  EXPECT_EQ(fault("0 7 1 1", "0 9 1 1"), "map.txt:11: visual map: observation 0: expected a point of its own track");
  EXPECT_EQ(fault("7 0.5 0 4 0 2 1", "7 0.5 0 4 0 2 -1"), "map.txt:9: visual map: point 0: expected a covariance");
  const auto absent = read_visual_map("/nonexistent/map.txt");
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().file, "/nonexistent/map.txt");
}

TEST(VisualMapFile, RefusesAMapThatDoesNotFitTogetherAndWritesNothing) {
  VisualMap map = *parse_visual_map(kSmall, "small");
  map.points.p[0][0] = NAN;
  const std::string path = testing::TempDir() + "oriel_visual_map_refused.txt";
  ASSERT_FALSE(write_visual_map(path, map));
  EXPECT_FALSE(std::filesystem::exists(path));
}

// Cut anywhere, it is not a map: the last line says `end`.
TEST(VisualMapFile, RefusesEveryTruncation) {
  for (std::size_t n = 0; n + 1 < kSmall.size(); ++n) {  // without the last newline it is whole
    const auto read = parse_visual_map(kSmall.substr(0, n), "cut");
    ASSERT_FALSE(read) << n;
    EXPECT_EQ(read.error().text().find("cut:"), 0u) << read.error();
    EXPECT_GT(read.error().line, 0) << n;
  }
}

// Damaged anywhere: one line, or a map that fits together and is written and read again.
TEST(VisualMapFile, SurvivesDamageAnywhere) {
  const std::string whole = format_visual_map(flown_map());
  const std::string bytes_of_harm = "0123456789-+.eEnaif \n\t#\0\xff";
  std::mt19937_64 random(11);
  int refused = 0, taken = 0;
  const auto damage = [&](std::string text) {
    for (std::uint64_t hits = 1 + random() % 4; hits > 0; --hits) {
      const std::size_t at = random() % text.size();
      const char c = bytes_of_harm[random() % bytes_of_harm.size()];
      switch (random() % 3) {
        case 0:
          text[at] = c;
          break;
        case 1:
          text.insert(at, 1 + random() % 3, c);
          break;
        default:
          text.erase(at, 1 + random() % 20);
      }
    }
    const auto read = parse_visual_map(text, "harmed");
    if (!read) {
      ++refused;
      EXPECT_EQ(read.error().text().find('\n'), std::string::npos);
      EXPECT_EQ(read.error().file, "harmed");
      EXPECT_GT(read.error().line, 0) << read.error();
      return;
    }
    ++taken;
    const auto again = parse_visual_map(format_visual_map(*read), "again");
    ASSERT_TRUE(again) << again.error();
    EXPECT_EQ(bytes(*again), bytes(*read));
  };
  for (int k = 0; k < 4000; ++k) damage(kSmall);
  for (int k = 0; k < 40; ++k) damage(whole);
  EXPECT_GT(refused, 1000);
  EXPECT_GT(taken, 200);
}

}  // namespace
}  // namespace oriel
