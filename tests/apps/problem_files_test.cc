// Problem files from outside: `oriel info`, and what `oriel solve` reads and writes.
#include "command_runner.h"

namespace oriel::apps {
namespace {

using nlohmann::json;
using ProblemFiles = CommandTest;

constexpr const char* kIndefinite =
    "EDGE_SE2 0 1 1 0 0 100 0 0 100 0 400\nEDGE_SE2 1 2 1 0 0 100 0 0 -1 0 400\nEDGE_SE2 2 0 -2 0 0 100 0 0 100 0 "
    "400\n";

TEST_F(ProblemFiles, AreDescribedByInfo) {
  const CommandResult r = oriel("info " + data("intel.g2o") + " --json -");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const json o = r.json();
  EXPECT_EQ(o["format"], "g2o");
  EXPECT_EQ(o["dimension"], 2);
  EXPECT_EQ(o["counts"]["poses"], 1728);
  EXPECT_EQ(o["counts"]["edges that close loops"], 785);
  EXPECT_EQ(o["component_count"], 1);
  EXPECT_EQ(o["components"][0]["free"], "translation and rotation (3)");
  EXPECT_EQ(o["suspicious"]["self"], 0);
  EXPECT_EQ(o["suspicious"]["far"], o["examples"].size());
  EXPECT_NEAR(o["cost"].get<double>(), 275.8678655, 1e-5);
  const CommandResult text = oriel("info " + data("problem-49-7776-pre.txt"));
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_NE(text.out.find("points: 7776"), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("scale (7)"), std::string::npos) << text.out;
}

TEST_F(ProblemFiles, ThatAreBadEndInfoWithOneLine) {
  for (const std::string& bad : {path("absent.g2o"), write("empty.g2o", ""), write("cut.g2o", "EDGE_SE2 0 1 1")}) {
    const CommandResult r = oriel("info " + bad + " --json " + path("out.json"));
    EXPECT_EQ(r.exit_code, 2);
    EXPECT_NE(r.err.find(bad), std::string::npos);
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1);
    EXPECT_FALSE(std::filesystem::exists(path("out.json")));
  }
}

TEST_F(ProblemFiles, WithIndefiniteInformationAreRefusedByTheirEdgesOrRepaired) {
  const std::string file = write("f.g2o", kIndefinite);
  const CommandResult refused = oriel("solve " + file);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.err.find("f.g2o:2: EDGE_SE2 1 2: "), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("--information project"), std::string::npos) << refused.err;
  const json repaired = solve(file + " --information project");
  EXPECT_EQ(repaired["information_repaired"], 1);
  EXPECT_TRUE(repaired["converged"]);
  EXPECT_EQ(oriel("info " + file + " --json -").json()["suspicious"]["indefinite"], 1);
}

TEST_F(ProblemFiles, OfIsamHoldWhatTheOptionSays) {
  const std::string edges = "ODOMETRY 0 1 1 0 0 10 0 0 10 0 20\nODOMETRY 1 2 1 0 0 10 0 0 10 0 20\n";
  const std::string file = write("f.txt", edges + "LANDMARK 0 0 1 1 2 0 2\nLANDMARK 2 0 -1 1.5 2 0 2\n");
  const json information = solve(file), root = solve(file + " --isam-noise root");
  EXPECT_EQ(information["format"], "isam");
  EXPECT_EQ(information["poses"], 3);
  EXPECT_EQ(information["landmarks"], 1);
  EXPECT_EQ(information["factors"], 4);
  EXPECT_NEAR(information["initial_cost"].get<double>(), 0.5 * 2 * 0.25, 1e-12);
  EXPECT_NEAR(root["initial_cost"].get<double>(), 0.5 * 4 * 0.25, 1e-12);
}

TEST_F(ProblemFiles, AreWrittenAsCloudsAndPicturesToo) {
  const std::string file = write("f.g2o", std::string("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\n") +
                                              "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\n"
                                              "EDGE_SE2 2 0 -1.7 0 0 1 0 0 1 0 1\n");
  const CommandResult r =
      oriel("solve " + file + " --init file --out " + path("out.ply") + " --svg " + path("out.svg"));
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(read(path("out.ply")).substr(0, 21), "ply\nformat ascii 1.0\n");
  EXPECT_NE(read(path("out.ply")).find("\n0.9 0 0 "), std::string::npos) << "a third of the gap off";
  EXPECT_NE(read(path("out.svg")).find(">after<"), std::string::npos);
  const CommandResult again = oriel("solve " + file + " --out " + path("out.g2o"));
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_NEAR(solve(path("out.g2o"))["initial_cost"].get<double>(), 0.5 * 0.03, 1e-9);
}

TEST_F(ProblemFiles, AreNotWrittenInAFormThatCannotHoldThem) {
  const CommandResult r = oriel("solve " + data("intel.g2o") + " --out " + path("out.bal"));
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_NE(r.err.find("out.bal"), std::string::npos) << r.err;
  EXPECT_FALSE(std::filesystem::exists(path("out.bal")));
  const CommandResult ba = oriel("solve " + data("problem-49-7776-pre.txt") + " --out " + path("out.g2o"));
  EXPECT_EQ(ba.exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(path("out.g2o")));
}

}  // namespace
}  // namespace oriel::apps
