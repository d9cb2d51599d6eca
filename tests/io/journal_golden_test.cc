// Journals of every version of the format, kept as text (tests/io/golden), are read for ever; what is written today is
// what is kept as the latest of them. ORIEL_GOLDEN=FILE writes one.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "io/golden_scenario.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/io/replay.h"

namespace oriel {
namespace {

namespace fs = std::filesystem;

class JournalGolden : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    path_ = (fs::temp_directory_path() / ("oriel_golden_" + std::to_string(::getpid()) + "_" + test->name())).string();
  }
  void TearDown() override { fs::remove(path_); }

  // The bytes of a golden file.
  static std::string golden(int version) {
    const std::string name =
        std::string(ORIEL_SOURCE_DIR) + "/tests/io/golden/journal_" + std::to_string(version) + ".hex";
    std::ifstream in(name);
    EXPECT_TRUE(in) << name;
    std::string line, bytes;
    while (std::getline(in, line))
      for (std::size_t i = 0; i + 1 < line.size() && line[0] != '#'; i += 2)
        bytes.push_back(static_cast<char>(std::stoi(line.substr(i, 2), nullptr, 16)));
    return bytes;
  }
  Result<ReplayReport> replay_bytes(const std::string& bytes, Graph& graph, bool verify = false) const {
    std::ofstream(path_, std::ios::binary) << bytes;
    return replay(path_, golden::types(), {verify, 0, false}, graph);
  }
  std::string written() const {
    std::ifstream in(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void expect_whole(int version, bool restricts, golden::Scenario& s, Graph& graph);
  // Without the first line and the message that names the build.
  static std::string content(const std::string& bytes) {
    std::uint64_t size = 0;
    std::memcpy(&size, bytes.data() + 24, sizeof(size));
    return bytes.substr(16 + Message::kHeaderBytes + size);
  }

  std::string path_;
};

// What the scenario leaves, said once more.
void expect_contents(const Graph& graph, const golden::Scenario& s, double late_x) {
  EXPECT_EQ(graph.variable_count(), 2u);
  EXPECT_EQ(graph.factor_count(), 2u);
  EXPECT_EQ(graph.value(s.start).p, (Vec3d{{1, 2, 3}}));  // solved for
  EXPECT_EQ(graph.value(s.late).p, (Vec3d{{late_x, late_x == 1.0 ? 1.0 : 0.0, late_x == 1.0 ? 1.0 : 0.0}}));
  EXPECT_FALSE(graph.contains(s.held));
  EXPECT_EQ(graph.describe(s.start), "point3/1 'start'");
  EXPECT_EQ(graph.describe(s.late), "point3/1 'late'");
  ASSERT_TRUE(graph.contains(s.first));
  const FactorTable& table = *graph.tables()[0];
  EXPECT_EQ(table.ops().residual, Prior<Point3d>::kName);
  EXPECT_EQ(table.loss(table.slots().find(s.first.key)).kind, LossKind::truncated);
  EXPECT_EQ(graph.priors().slots().size(), 1u);
  EXPECT_TRUE(graph.find_pool(kVariableOps<Point3d>.key)->has_first_estimate(1));
}

TEST_F(JournalGolden, OfVersionOneIsRead) {
  golden::Scenario s;
  s.record(path_, false);
  Graph graph;
  const auto report = replay_bytes(golden(1), graph, true);
  ASSERT_TRUE(report) << report.error();
  EXPECT_FALSE(report->damage);
  EXPECT_EQ(report->messages, 7);  // build, edit, solve, solution, outcome, edit, edit
  EXPECT_EQ(report->edits, 3);
  EXPECT_EQ(report->solves, 1);
  EXPECT_EQ(report->differing, 0);  // its numbers are exact on any machine
  EXPECT_EQ(fingerprint(graph), fingerprint(s.graph));
  expect_contents(graph, s, 1.0);
}

// One with the whole of a graph, which a follower that fell behind is told.
void JournalGolden::expect_whole(int version, bool restricts, golden::Scenario& s, Graph& graph) {
  s.record(path_, true, restricts);
  const auto report = replay_bytes(golden(version), graph, true);
  ASSERT_TRUE(report) << report.error();
  EXPECT_FALSE(report->damage);
  EXPECT_EQ(report->messages, 8);
  EXPECT_EQ(report->edits, 4);
  EXPECT_EQ(report->differing, 0);
  EXPECT_EQ(fingerprint(graph), fingerprint(s.graph));
  expect_contents(graph, s, 2.0);
}

TEST_F(JournalGolden, OfVersionTwoIsReadAndHasTheWholeOfAGraph) {
  golden::Scenario s;
  Graph graph;
  expect_whole(2, false, s, graph);
}

TEST_F(JournalGolden, OfMessagesOfVersionThreeIsReadAndHasFreedoms) {
  golden::Scenario s;
  Graph graph;
  expect_whole(3, true, s, graph);
  EXPECT_EQ(graph.freedom(s.late), Freedom::hold({1}));
  EXPECT_EQ(graph.freedom(s.start), Freedom::hold({0, 2}, Freedom::Axes::world));
}

// A change of the format without another version would show here.
TEST_F(JournalGolden, OfTheLatestVersionIsWhatIsWrittenToday) {
  golden::Scenario s;
  const char* wanted = std::getenv("ORIEL_GOLDEN");
  s.record(wanted != nullptr ? wanted : path_, true, true);
  if (wanted != nullptr) GTEST_SKIP() << "written to " << wanted;
  EXPECT_EQ(written().substr(0, 16), golden(3).substr(0, 16));
  EXPECT_TRUE(content(written()) == content(golden(3)));
}

TEST_F(JournalGolden, IsGoodUpToAnyByteThatIsMissingOrChanged) {
  for (const int version : {1, 2, 3}) {
    const std::string whole = golden(version);
    for (std::size_t n = 60; n < whole.size(); ++n) {
      Graph cut, changed;
      const auto shorter = replay_bytes(whole.substr(0, n), cut);
      ASSERT_TRUE(shorter) << shorter.error();
      EXPECT_TRUE(shorter->damage || version == 1) << n;  // version 1 has no end to miss
      EXPECT_LE(shorter->messages, 8);
      std::string damaged = whole;
      damaged[n] = static_cast<char>(damaged[n] ^ 0x11);
      const auto other = replay_bytes(damaged, changed);
      ASSERT_TRUE(other) << other.error();
      ASSERT_TRUE(other->damage) << "version " << version << ", byte " << n;
      EXPECT_NE(other->damage->text().find("before it are whole"), std::string::npos) << *other->damage;
    }
  }
}

TEST_F(JournalGolden, WithMessagesOfAnotherVersionIsRefusedWithBothNumbers) {
  std::string bytes = golden(2);
  bytes[20] = 1;
  Graph graph;
  const auto report = replay_bytes(bytes, graph);
  ASSERT_FALSE(report);
  EXPECT_NE(report.error().text().find("version 1, 2 to 3 expected"), std::string::npos) << report.error();
}

TEST_F(JournalGolden, SaysSoWhereSomethingFollowsItsEnd) {
  const std::string whole = golden(2);
  Graph graph;
  const auto report = replay_bytes(whole + "x", graph);
  ASSERT_TRUE(report) << report.error();
  ASSERT_TRUE(report->damage);
  EXPECT_NE(report->damage->text().find("something follows its end"), std::string::npos) << *report->damage;
  EXPECT_EQ(report->messages, 8);
}

}  // namespace
}  // namespace oriel
