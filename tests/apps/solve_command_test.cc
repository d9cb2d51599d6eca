// `oriel solve` from outside: options, JSON, exit codes, files.
#include <set>

#include "command_runner.h"

namespace oriel::apps {
namespace {

using nlohmann::json;
using SolveCommand = CommandTest;

// Two poses that a third joins at right angles; the odometry of it closes but for one loop.
constexpr const char* kSquare =
    "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0.2 1.5\nVERTEX_SE2 2 1.1 1 3.1\nVERTEX_SE2 3 0 1.2 -1.5\n"
    "EDGE_SE2 0 1 1 0 1.5707963 100 0 0 100 0 400\nEDGE_SE2 1 2 1 0 1.5707963 100 0 0 100 0 400\n"
    "EDGE_SE2 2 3 1 0 1.5707963 100 0 0 100 0 400\nEDGE_SE2 3 0 1.1 0 1.5707963 100 0 0 100 0 400\n";

std::string without_vertices(const std::string& text) { return text.substr(text.find("EDGE")); }

TEST_F(SolveCommand, ReachesTheKnownOptimaOfTheShippedProblems) {
  const CommandResult r = oriel("solve " + data("intel.g2o") + " " + data("sphere2500.g2o") + " --json -");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const json solved = r.json();
  ASSERT_EQ(solved.size(), 2u);
  EXPECT_NEAR(solved[0]["final_cost"].get<double>(), 22.502348, 22.5 * 2e-6);
  EXPECT_NEAR(solved[1]["final_cost"].get<double>(), 363.5748335, 363.6 * 2e-6);
  EXPECT_EQ(solved[1]["file"], data("sphere2500.g2o"));
}

TEST_F(SolveCommand, SolvesABundleAdjustment) {
  const json o = solve(data("problem-49-7776-pre.txt"));
  EXPECT_EQ(o["format"], "bal");
  EXPECT_EQ(o["poses"], 49);
  EXPECT_EQ(o["landmarks"], 7776);
  EXPECT_EQ(o["factors"], 31843);
  EXPECT_LE(o["final_cost"].get<double>(), 13344.35 * (1 + 1e-4));
}

TEST_F(SolveCommand, ReportsEveryKeyOfItsContract) {
  const json o = solve(write("square.g2o", kSquare));
  for (const char* key :
       {"file", "format", "poses", "landmarks", "factors", "initial_cost", "final_cost", "trace", "iterations",
        "converged", "reason", "method", "linear_solver", "threads", "seconds", "peak_rss_mb", "gauge", "undetermined"})
    EXPECT_TRUE(o.contains(key)) << key;
  for (const char* key : {"read", "setup", "solve", "total"}) EXPECT_GE(o["seconds"][key].get<double>(), 0.0) << key;
  EXPECT_EQ(o["format"], "g2o");
  EXPECT_EQ(o["method"], "lm");
  EXPECT_EQ(o["gauge"], "first pose held (id 0)");
  EXPECT_TRUE(o["undetermined"].empty());
  EXPECT_GT(o["peak_rss_mb"].get<double>(), 0.0);
}

TEST_F(SolveCommand, TracesTheBestCostFromTheStartToTheEnd) {
  const json o = solve(data("intel.g2o"));
  const json& trace = o["trace"];
  ASSERT_GE(trace.size(), 2u);
  EXPECT_EQ(trace.front()["cost"], o["initial_cost"]);
  EXPECT_EQ(trace.back()["cost"], o["final_cost"]);
  for (std::size_t i = 1; i < trace.size(); ++i) {
    EXPECT_LE(trace[i]["cost"].get<double>(), trace[i - 1]["cost"].get<double>());
    EXPECT_GE(trace[i]["seconds"].get<double>(), trace[i - 1]["seconds"].get<double>());
  }
  EXPECT_LE(trace.back()["seconds"].get<double>(), o["seconds"]["solve"].get<double>());
}

TEST_F(SolveCommand, PutsTheJsonAloneOnStandardOutput) {
  const CommandResult r = oriel("solve " + write("square.g2o", kSquare) + " --json -");
  EXPECT_TRUE(r.json().is_array()) << r.out;
  EXPECT_TRUE(r.err.empty()) << r.err;
}

TEST_F(SolveCommand, WritesTheJsonToAFileAndTextForPeople) {
  const CommandResult r = oriel("solve " + write("square.g2o", kSquare) + " --json " + path("report.json"));
  EXPECT_EQ(r.exit_code, 0);
  EXPECT_NE(r.out.find("converged"), std::string::npos) << r.out;
  EXPECT_TRUE(json::parse(read(path("report.json")), nullptr, false).is_array());
}

// L10
TEST_F(SolveCommand, GivesTheSameBitsWithOneAndTwoThreads) {
  ASSERT_EQ(oriel("solve " + data("sphere2500.g2o") + " --out " + path("one.g2o")).exit_code, 0);
  ASSERT_EQ(oriel("solve " + data("sphere2500.g2o") + " --threads 2 --out " + path("two.g2o")).exit_code, 0);
  EXPECT_EQ(read(path("one.g2o")), read(path("two.g2o")));
}

TEST_F(SolveCommand, WritesAFileThatStartsAtTheCostItEndedWith) {
  for (const std::string name : {"intel.g2o", "problem-49-7776-pre.txt"}) {
    const json first = solve(data(name) + " --iterations 3 --out " + path(name));
    const json again = solve(path(name) + " --iterations 0 --init file");
    const double cost = first["final_cost"];
    EXPECT_NEAR(again["initial_cost"].get<double>(), cost, 1e-9 * cost) << name;
    EXPECT_EQ(again["factors"], first["factors"]);
  }
}

TEST_F(SolveCommand, ChainsTheEdgesWhereThereIsNoVertexLine) {
  const json o = solve(write("edges.g2o", without_vertices(kSquare)) + " --init file");
  EXPECT_EQ(o["start"], "odometry");
  EXPECT_EQ(o["poses"], 4);
  EXPECT_NEAR(o["final_cost"].get<double>(), solve(write("square.g2o", kSquare))["final_cost"].get<double>(), 1e-9);
}

TEST_F(SolveCommand, StartsWhereItCostsLessUnlessToldWhere) {
  const std::string file = write("square.g2o", kSquare);
  const json from_file = solve(file + " --init file"), chained = solve(file + " --init odometry"), best = solve(file);
  EXPECT_EQ(from_file["start"], "file");
  EXPECT_EQ(chained["start"], "odometry");
  EXPECT_LT(chained["initial_cost"].get<double>(), from_file["initial_cost"].get<double>());
  EXPECT_EQ(best["start"], "chordal");
  EXPECT_EQ(solve(data("sphere2500.g2o") + " --iterations 0")["start"], "chordal");
  ASSERT_EQ(oriel("solve " + file + " --out " + path("solved.g2o")).exit_code, 0);
  EXPECT_EQ(solve(path("solved.g2o"))["start"], "file");  // nothing costs less than the minimum
}

TEST_F(SolveCommand, LeavesPosesThatFixHoldsWhereTheFileHasThem) {
  const std::string file = write("square.g2o", std::string(kSquare) + "FIX 0 2\n");
  const json o = solve(file + " --init odometry --out " + path("out.g2o"));
  EXPECT_EQ(o["gauge"], "held by FIX (2 poses)");
  const std::string out = read(path("out.g2o"));
  EXPECT_NE(out.find("VERTEX_SE2 2 1.1 1 3.1\n"), std::string::npos) << out;
  EXPECT_NEAR(o["final_cost"].get<double>(), solve(file + " --init file")["final_cost"].get<double>(), 1e-8);
}

TEST_F(SolveCommand, TakesTheRotationVectorInPlaceOfTheQuaternionWhenToldTo) {
  const json o = solve(data("sphere2500.g2o") + " --rotation-error log");
  EXPECT_NEAR(o["final_cost"].get<double>(), 0.5 * 1351.362327, 675.7 * 2e-6);
}

TEST_F(SolveCommand, CountsTheLossInTheCost) {
  const std::string file = write("square.g2o", kSquare);
  const json plain = solve(file + " --init file"), huber = solve(file + " --init file --loss huber:1"),
             cauchy = solve(file + " --init file --loss cauchy:3");
  EXPECT_LT(huber["initial_cost"].get<double>(), plain["initial_cost"].get<double>());
  EXPECT_LT(cauchy["initial_cost"].get<double>(), plain["initial_cost"].get<double>());
  EXPECT_TRUE(huber["converged"]);
  EXPECT_TRUE(cauchy["converged"]);
}

TEST_F(SolveCommand, SolvesByGaussNewtonWhenToldTo) {
  const json o = solve(data("intel.g2o") + " --method gn");
  EXPECT_EQ(o["method"], "gn");
  EXPECT_NEAR(o["final_cost"].get<double>(), 22.502348, 22.5 * 2e-6);
}

TEST_F(SolveCommand, EndsWithOneWhereALimitComesFirst) {
  for (const std::string limit : {"--iterations 1", "--deadline 1"}) {
    const CommandResult r = oriel("solve " + data("sphere2500.g2o") + " " + limit + " --json -");
    EXPECT_EQ(r.exit_code, 1) << limit;
    const json o = r.json();
    ASSERT_TRUE(o.is_array()) << limit;
    EXPECT_FALSE(o[0]["converged"]) << limit;
    EXPECT_LE(o[0]["final_cost"].get<double>(), o[0]["initial_cost"].get<double>());
  }
}

TEST_F(SolveCommand, IsNotConvergedWhereAFactorIsNotFinite) {
  const std::string far = write("far.g2o",
                                "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1e200 0 0\n"
                                "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n");
  const CommandResult r = oriel("solve " + far + " --init file --json -");
  EXPECT_EQ(r.exit_code, 1) << r.err;
  ASSERT_TRUE(r.json().is_array()) << r.out;
  EXPECT_FALSE(r.json()[0]["converged"]);
  EXPECT_EQ(r.json()[0]["invalid_factors"], 1);
  EXPECT_EQ(oriel("solve " + far).exit_code, 0);  // the odometry is fine
}

// L6
TEST_F(SolveCommand, NamesPosesThatNothingDetermines) {
  const json o = solve(write("lone.g2o", "VERTEX_SE2 17 5 5 0\n" + std::string(kSquare)));
  EXPECT_TRUE(o["converged"]);
  std::set<std::string> texts;
  for (const json& text : o["undetermined"]) texts.insert(text.get<std::string>());
  EXPECT_EQ(texts, (std::set<std::string>{"pose 17: rotation [rad]", "pose 17: translation x [m]",
                                          "pose 17: translation y [m]"}));
}

TEST_F(SolveCommand, AnswersBadInputWithOneLineThatNamesFileAndLine) {
  const std::string cut = write("cut.g2o", std::string(kSquare) + "EDGE_SE2 0 1 1 0\n");
  const CommandResult r = oriel("solve " + cut + " --json - --out " + path("out.g2o"));
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_TRUE(r.out.empty()) << r.out;
  EXPECT_NE(r.err.find(cut + ":9: "), std::string::npos) << r.err;
  EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  EXPECT_FALSE(std::filesystem::exists(path("out.g2o")));
}

TEST_F(SolveCommand, WritesNothingWhereOneOfSeveralFilesIsBad) {
  const std::string good = write("good.g2o", kSquare), bad = write("bad.g2o", "VERTEX_NOPE 1\n");
  for (const std::string& target : {std::string("-"), path("report.json")}) {
    const CommandResult r = oriel("solve " + good + " " + bad + " --json " + target);
    EXPECT_EQ(r.exit_code, 2);
    EXPECT_TRUE(r.out.empty()) << r.out;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  }
  EXPECT_FALSE(std::filesystem::exists(path("report.json")));
}

TEST_F(SolveCommand, RefusesAWrongCommandLineWithOneLine) {
  const std::string file = write("square.g2o", kSquare);
  for (const std::string arguments :
       {"", "--method newton", "--loss huber", "--loss huber:-1", "--init map", "--iterations -1", "--threads 0",
        "--threads two", "--deadline 0", "--rotation-error euler", "--json", "--nonsense", "--out -",
        "--out /nonexistent/folder/out.g2o", "--json /nonexistent/folder/report.json"}) {
    const CommandResult r = oriel("solve " + (arguments.empty() ? "" : file + " " + arguments));
    EXPECT_EQ(r.exit_code, 2) << arguments;
    EXPECT_TRUE(r.out.empty()) << arguments << ": " << r.out;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << arguments << ": " << r.err;
  }
}

}  // namespace
}  // namespace oriel::apps
