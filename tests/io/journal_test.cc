// Journals: what was recorded comes back with the same bits, up to the damage if there is one.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "graph/random_graph.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/io/journal.h"
#include "oriel/io/replay.h"

namespace oriel {
namespace {

namespace fs = std::filesystem;
using testing_graph::random_graph_types;
using testing_graph::RandomGraph;

// A file of its own for each test, gone afterwards.
class Journal : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    path_ = (fs::temp_directory_path() / ("oriel_journal_" + std::to_string(::getpid()) + "_" + test->name())).string();
  }
  void TearDown() override { fs::remove(path_); }

  // A run of random edits and solves; the fingerprint at its end.
  std::uint64_t record(unsigned seed, int rounds) {
    RandomGraph origin(seed, true);
    NativeEngine engine(origin.graph);
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(origin.step(8));  // before the journal was opened
    auto journal = JournalWriter::create(path_, origin.graph);
    if (!journal) {
      ADD_FAILURE() << journal.error();
      return 0;
    }
    for (int i = 0; i < rounds; ++i) {
      for (int edits = 1 + origin.below(3); edits > 0; --edits) EXPECT_TRUE(origin.step(8));
      journal->edited();
      SolveOptions options;
      options.max_iterations = 1 + origin.below(6);
      if (origin.below(4) == 0) options.callback = [](const IterationReport& r) { return r.iteration < 1; };
      const SolverState before = engine.state();
      const Summary summary = engine.solve(options);
      journal->solved(options, before, summary, engine);
    }
    EXPECT_TRUE(origin.step(8));
    const auto ok = journal->close();
    EXPECT_TRUE(ok) << ok.error();
    return fingerprint(origin.graph);
  }
  std::string bytes() const {
    std::ifstream in(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void write(const std::string& bytes) const { std::ofstream(path_, std::ios::binary) << bytes; }

  std::string path_;
};

TEST_F(Journal, GivesTheGraphBackWithTheSameBits) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const std::uint64_t end = record(seed, 25);
    Graph graph;
    const auto report = replay(path_, random_graph_types(), {}, graph);
    ASSERT_TRUE(report) << report.error();
    EXPECT_EQ(fingerprint(graph), end);
    EXPECT_EQ(report->solves, 25);
    EXPECT_GT(report->adoptions, 15);
    EXPECT_EQ(report->differing, 0);
    EXPECT_FALSE(report->damage);
    EXPECT_EQ(report->build, build_name());
  }
}

// L10: also with other threads, and with every cache dropped.
TEST_F(Journal, GivesTheSameBitsWhenItIsSolvedAgain) {
  for (unsigned seed = 4; seed <= 6; ++seed) {
    const std::uint64_t end = record(seed, 25);
    for (const ReplayOptions& options : {ReplayOptions{true, 0, false}, {true, 2, false}, {true, 1, true}}) {
      Graph graph;
      const auto report = replay(path_, random_graph_types(), options, graph);
      ASSERT_TRUE(report) << report.error();
      EXPECT_EQ(fingerprint(graph), end);
      EXPECT_EQ(report->differing, 0) << "first after solve " << report->first_differing;
    }
  }
}

// C1: a journal that is told of edits too seldom holds the whole graph now and then.
TEST_F(Journal, GivesTheGraphBackWhereTheJournalHadFallenBehind) {
  RandomGraph origin(12, true);
  origin.graph.bound_log({.per_live = 0.2, .least = 4});
  NativeEngine engine(origin.graph);
  auto journal = JournalWriter::create(path_, origin.graph);
  ASSERT_TRUE(journal) << journal.error();
  for (int round = 0; round < 12; ++round) {
    for (int edits = 0; edits < 8; ++edits) ASSERT_TRUE(origin.step(8));
    journal->edited();
    const SolverState before = engine.state();
    const Summary summary = engine.solve();
    journal->solved({}, before, summary, engine);
  }
  EXPECT_GT(origin.graph.log().left_behind(), 5u);
  ASSERT_TRUE(journal->close());
  for (const bool verify : {false, true}) {
    Graph graph;
    const auto report = replay(path_, random_graph_types(), {verify, 0, false}, graph);
    ASSERT_TRUE(report) << report.error();
    EXPECT_EQ(report->differing, 0);
    EXPECT_EQ(fingerprint(graph), fingerprint(origin.graph));
  }
}

TEST_F(Journal, IsGoodUpToTheByteWhereItWasCut) {
  record(7, 4);
  const std::string whole = bytes();
  std::int64_t before = 0;
  for (std::size_t n = 100; n < whole.size(); n += 97) {
    write(whole.substr(0, n));
    Graph graph;
    const auto report = replay(path_, random_graph_types(), {}, graph);
    ASSERT_TRUE(report) << report.error();
    EXPECT_GE(report->messages, before);
    before = report->messages;
    ASSERT_TRUE(report->damage) << n;  // also of one that is cut between two messages
    EXPECT_NE(report->damage->text().find("cut short"), std::string::npos) << *report->damage;
    EXPECT_NE(report->damage->text().find("the " + std::to_string(report->messages) + " before it are whole"),
              std::string::npos)
        << *report->damage;
  }
  EXPECT_GT(before, 8);
}

TEST_F(Journal, SaysWhereAByteWasChanged) {
  record(8, 4);
  const std::string whole = bytes();
  for (std::size_t at = 60; at < whole.size(); at += 131) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x20);
    write(damaged);
    Graph graph;
    const auto report = replay(path_, random_graph_types(), {}, graph);
    ASSERT_TRUE(report) << report.error();
    EXPECT_TRUE(report->damage) << "byte " << at;
  }
}

TEST_F(Journal, IsRefusedWhereItIsSomethingElse) {
  write("TIMESTAMP,x,y,z\n1,2,3,4\n");
  Graph graph;
  const auto other = replay(path_, random_graph_types(), {}, graph);
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().text(), path_ +
                                      ":1: it is no journal of a version that is known (\"oriel journal 1\" or "
                                      "\"oriel journal 2\" expected)");
  const auto none = replay(path_ + "_not_there", random_graph_types(), {}, graph);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::not_found);
}

TEST_F(Journal, NamesATypeThatTheReaderDoesNotKnow) {
  record(9, 3);
  TypeList few;
  few.variable<Pose3d>().variable<Point3d>().variable<Velocity3d>();
  Graph graph;
  const auto report = replay(path_, few, {}, graph);
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().code, ErrorCode::not_found);
  EXPECT_NE(report.error().text().find("message 2"), std::string::npos) << report.error();
}

TEST_F(Journal, RefusesToGoOnWhereAnEditWasKeptFromIt) {
  RandomGraph origin(10, true);
  NativeEngine engine(origin.graph);
  auto journal = JournalWriter::create(path_, origin.graph);
  ASSERT_TRUE(journal) << journal.error();
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(origin.step(8));
  const SolverState before = engine.state();
  const Summary summary = engine.solve();
  ASSERT_GT(summary.accepted, 0);
  journal->solved({}, before, summary, engine);
  ASSERT_FALSE(journal->status());
  EXPECT_EQ(journal->status().error().code, ErrorCode::conflict);
}

TEST_F(Journal, IsAnErrorWhereItCannotBeWritten) {
  Graph graph;
  EXPECT_FALSE(JournalWriter::create(path_ + "_folder/that/is/not/there", graph));
  if (!fs::exists("/dev/full")) return;
  RandomGraph origin(11, true);
  auto journal = JournalWriter::create("/dev/full", origin.graph);
  ASSERT_TRUE(journal);  // what is small waits in a buffer
  for (int i = 0; i < 400; ++i) {
    ASSERT_TRUE(origin.step(8));
    journal->edited();
  }
  EXPECT_FALSE(journal->close());
}

}  // namespace
}  // namespace oriel
