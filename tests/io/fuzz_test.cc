// The short form of ./test --fuzz: the same promises of the readers, over real files that were cut and spoiled by fixed
// seeds.
#include <gtest/gtest.h>
#include <zlib.h>

#include <random>
#include <string>
#include <vector>

#include "fuzz/readers.h"
#include "oriel/io/run_config.h"
#include "oriel/io/text.h"

namespace oriel {
namespace {

std::string head_of(const std::string& name, std::size_t bytes) {
  const auto text = read_text_file(std::string(ORIEL_DATA_DIR) + "/" + name);
  EXPECT_TRUE(text) << text.error();
  return text ? text->substr(0, text->rfind('\n', bytes) + 1) : "";
}

// The lines of a file that begin with a tag, at most so many of them.
std::string lines_of(const std::string& name, const std::string& tag, int count) {
  const auto text = read_text_file(std::string(ORIEL_DATA_DIR) + "/" + name);
  std::string out;
  for (std::size_t at = 0; text && at < text->size() && count > 0;) {
    const std::size_t end = std::min(text->find('\n', at), text->size() - 1);
    if (text->compare(at, tag.size(), tag) == 0) out.append(*text, at, end + 1 - at), --count;
    at = end + 1;
  }
  return out;
}

const std::string kLandmarks =
    "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0.1\nVERTEX_XY 7 1 1\nEDGE_SE2 0 1 1 0 0.1 9 1 0 9 0 4\n"
    "EDGE_SE2_XY 0 7 1 1 4 1 4\nEDGE_BEARING_SE2_XY 1 7 1.5 8\nFIX 0 7\n";
const std::string kSpatialLandmarks =
    "PARAMS_SE3OFFSET 0 0 0 1 0 0 0 1\nVERTEX_SE3:QUAT 3 1 2 3 0 0 0.6 0.8\nVERTEX_TRACKXYZ 8 1 1 1\n"
    "EDGE_SE3_TRACKXYZ 3 8 0 1 2 3 4 0 0 4 0 4\n";
const std::string kToro =
    "VERTEX3 0 0 0 0 0.1 0.2 0.3\nVERTEX3 1 0 0 1 0.1 0.2 0.3\n"
    "EDGE3 0 1 1 2 3 0.1 0.2 0.3 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
const std::string kIsam =
    "ODOMETRY 0 1 1 0 0 10 0 0 10 0 20\nEDGE2 1 2 1 0 0 10 0 0 10 0 20\nLANDMARK 0 0 1 1 2 0 2\n"
    "LANDMARK 2 0 -1 1.5 2 0 2\n";
const std::string kBal =
    "2 2 4\n0 0 -10 0\n0 1 -10 0\n1 0 0 0\n1 1 0 200\n0 0 0 0.1 0 0 100 0 0\n0 0 0 1 0 0 100 1e-3 0\n-1 0 -10\n5 0 "
    "10\n";
const std::string kImu =
    "#t,wx,wy,wz,ax,ay,az\n1403636579763555584,-0.1,0.14,0.08,8.1,-0.3,-2.5\n1403636579768555584,0,0,0,0,0,9.8\n";
const std::string kTum = "# t x y z q\n1.5 1 2 3 0 0 0 1\n2.5 1 2 3 0 0.6 0 0.8\n";
const std::string kTracks = "timestamp_ns,frame,track_id,u0,v0,u1,v1\n100,0,1,10.5,20,,\n100,0,2,1,2,3,4\n";

class Spoiler {
 public:
  explicit Spoiler(unsigned seed) : random_(seed) {}

  std::string spoil(std::string text) {
    const int times = 1 + below(4);
    for (int k = 0; k < times && !text.empty(); ++k) once(text);
    return text;
  }

 private:
  int below(std::size_t n) { return static_cast<int>(random_() % n); }

  // Of what is between two blanks, or of a line.
  std::pair<std::size_t, std::size_t> piece(const std::string& text, const char* ends) {
    const auto at = static_cast<std::size_t>(below(text.size()));
    const std::size_t first = text.find_last_of(ends, at), last = text.find_first_of(ends, at);
    const std::size_t from = first == std::string::npos ? 0 : first + 1, to = std::min(last, text.size());
    return {std::min(from, to), to};
  }

  void once(std::string& text) {
    static const char* const kWords[] = {"nan",
                                         "inf",
                                         "-1",
                                         "0",
                                         "1e308",
                                         "1e-320",
                                         "-1e308",
                                         "2305843009213693952",
                                         "9223372036854775807",
                                         "99999999999999999999",
                                         "1",
                                         "7",
                                         "FIX",
                                         "EDGE2",
                                         "#",
                                         "EDGE_SE2",
                                         "0.0",
                                         "abc",
                                         ".",
                                         "-",
                                         "+1",
                                         "1e",
                                         "\t",
                                         "\r",
                                         ""};
    switch (below(7)) {
      case 0:
        text[static_cast<std::size_t>(below(text.size()))] = static_cast<char>(random_());
        break;
      case 1:
        text.resize(static_cast<std::size_t>(below(text.size() + 1)));
        break;
      case 2: {
        const auto [from, to] = piece(text, " ,\n");
        text.replace(from, to - from, kWords[below(std::size(kWords))]);
        break;
      }
      case 3: {
        const auto [from, to] = piece(text, "\n");
        text.erase(from, to + 1 - from);
        break;
      }
      case 4: {
        const auto [from, to] = piece(text, "\n");
        text.insert(static_cast<std::size_t>(below(text.size())), text.substr(from, to + 1 - from));
        break;
      }
      case 5: {
        const auto [from, to] = piece(text, " ,\n");
        text.insert(to, std::string(1 + static_cast<std::size_t>(below(3)), " 0\n"[below(3)]));
        break;
      }
      default: {
        const auto [from, to] = piece(text, " ,\n");
        text.erase(from, to - from);
      }
    }
  }

  std::mt19937 random_;
};

template <class Judge>
void spoil_all(const std::vector<std::string>& files, int rounds, Judge&& judge) {
  for (std::size_t f = 0; f < files.size(); ++f) {
    ASSERT_FALSE(files[f].empty()) << f;
    Spoiler spoiler(static_cast<unsigned>(100 + f));
    judge(files[f]);
    for (int k = 0; k < rounds; ++k) judge(spoiler.spoil(files[f]));
  }
}

// V5
TEST(ReadersOfProblems, KeepTheirPromisesForSpoiledPoseGraphs) {
  const std::string intel = lines_of("intel.g2o", "VERTEX", 10) + lines_of("intel.g2o", "EDGE_SE2", 9);
  const std::string sphere = lines_of("sphere2500.g2o", "EDGE", 6);
  spoil_all({intel, sphere, kLandmarks, kSpatialLandmarks, kToro, kIsam}, 8000, fuzz::pose_graph);
}

TEST(ReadersOfProblems, KeepTheirPromisesForSpoiledBundleAdjustments) {
  spoil_all({kBal, head_of("problem-49-7776-pre.txt", 2000)}, 20000, fuzz::bal);
}

TEST(ReadersOfProblems, KeepTheirPromisesForSpoiledPackedFiles) {
  std::string packed(4096, '\0');
  const std::string text = kBal + kBal;
  z_stream z{};
  ASSERT_EQ(deflateInit2(&z, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);
  z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  z.avail_in = static_cast<unsigned>(text.size());
  z.next_out = reinterpret_cast<Bytef*>(packed.data());
  z.avail_out = static_cast<unsigned>(packed.size());
  ASSERT_EQ(deflate(&z, Z_FINISH), Z_STREAM_END);
  packed.resize(packed.size() - z.avail_out);
  deflateEnd(&z);
  spoil_all({packed, "BZh9" + packed}, 20000, fuzz::packed);
}

TEST(ReadersOfTables, KeepTheirPromisesForSpoiledFiles) { spoil_all({kImu, kTum, kTracks}, 20000, fuzz::tables); }

TEST(ReadersOfMaps, KeepTheirPromisesForSpoiledVisualMaps) {
  const auto seed = read_text_file(std::string(ORIEL_SOURCE_DIR) + "/fuzz/seeds/small.map");
  ASSERT_TRUE(seed) << seed.error();
  spoil_all({*seed}, 20000, fuzz::visual_map);
}

// R9
TEST(ReadersOfConfigs, KeepTheirPromisesForSpoiledConfigs) {
  const std::string window =
      "task: sliding_window\nexecutor: inline\nwindow: {policy: {name: lag, max_states: 6}, landmarks: keep}\n"
      "providers:\n  - {name: constant_velocity, longest: 3}\nbuilders:\n  - name: structureless\n    loss: huber:3\n"
      "hooks: [refine, {name: mahalanobis_gate, builder: structureless}]\n";
  const std::string odometry =
      "task: inertial_odometry\nexecutor: process\nvisual: {loss: 'barron:2:-inf'}\nkeyframes:\n  max_keyframes: 7\n";
  spoil_all({window, odometry}, 1500, [](const std::string& text) {
    const auto reading = parse_run_config(text, "f");
    for (const Error& e : reading.errors) {
      fuzz::require_short_line(e);
      EXPECT_GE(e.line, 0);
    }
    if (!reading.errors.empty()) return;
    const std::string once = run_config_text(reading.config);
    const auto again = parse_run_config(once, "again");
    ASSERT_TRUE(again.errors.empty()) << again.errors[0] << text;
    EXPECT_EQ(run_config_text(again.config), once);
  });
}

}  // namespace
}  // namespace oriel
