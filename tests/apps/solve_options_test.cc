// oriel solve: what it can be told beside files and starts.
#include <gtest/gtest.h>

#include <cmath>

#include "apps/command_runner.h"

namespace oriel::apps {
namespace {

using nlohmann::json;

class SolveOptionsOfTheCommand : public CommandTest {};

// A row of four poses; the loop from the first to the last is wrong by 20 m.
constexpr const char* kRow =
    "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\nVERTEX_SE2 3 3 0 0\n"
    "EDGE_SE2 0 1 1 0 0 4 0 0 4 0 4\nEDGE_SE2 1 2 1 0 0 4 0 0 4 0 4\nEDGE_SE2 2 3 1 0 0 4 0 0 4 0 4\n";
constexpr const char* kWrongLoop = "EDGE_SE2 0 3 23 0 0 4 0 0 4 0 4\n";

// L11: of a chain with sigma 0.5 a step, by hand: y of the second pose is moved by the first turn too.
TEST_F(SolveOptionsOfTheCommand, GivesCovariancesOfTheVariablesThatAreNamed) {
  const std::string file = write("row.g2o", kRow);
  const json marginal = solve(file + " --covariance 1,2")["covariance"];
  ASSERT_EQ(marginal.size(), 2u);
  EXPECT_EQ(marginal[1]["variables"][0], "pose 2");
  EXPECT_EQ(marginal[1]["tangents"][2], "pose 2: translation y [m]");
  EXPECT_NEAR(marginal[0]["matrix"][2][2].get<double>(), 0.25, 1e-12);
  EXPECT_NEAR(marginal[1]["matrix"][0][0].get<double>(), 0.5, 1e-12);
  EXPECT_NEAR(marginal[1]["matrix"][2][2].get<double>(), 0.75, 1e-12);
  const json joint = solve(file + " --covariance 1,2 --joint")["covariance"];
  ASSERT_EQ(joint.size(), 1u);
  EXPECT_NEAR(joint[0]["matrix"][0][3].get<double>(), 0.25, 1e-12);  // both turn with the first edge
  EXPECT_NEAR(joint[0]["matrix"][5][5].get<double>(), 0.75, 1e-12);
  const json none = solve(data("problem-49-7776-pre.txt") + " --iterations 1 --covariance 0")["covariance"];
  EXPECT_TRUE(none[0]["matrix"].empty());
  EXPECT_FALSE(none[0]["error"].get<std::string>().empty());
}

// L8
TEST_F(SolveOptionsOfTheCommand, LeavesOddLoopsOutByALossOnLoopsOrByGraduation) {
  const std::string file = write("loop.g2o", std::string(kRow) + kWrongLoop);
  EXPECT_GT(solve(file)["final_cost"].get<double>(), 100.0);
  for (const std::string loss : {"truncated:2", "tukey:2", "geman-mcclure:2", "barron:2:-inf"}) {
    const json o = solve(file + " --init file --loss-on loops --loss " + loss);
    EXPECT_LT(o["final_cost"].get<double>(), 4.1) << loss;  // at most ½ρ of one loop, and odometry is not bent
  }
  const json graduated = solve(file + " --gnc");
  EXPECT_EQ(graduated["gnc"]["factors"], 1);  // odometry is trusted
  EXPECT_EQ(graduated["gnc"]["outliers"], 1);
  EXPECT_GT(graduated["gnc"]["rounds"], 2);
  EXPECT_LT(graduated["final_cost"].get<double>(), 1.6);  // ½ρ ≤ ½ dim
}

TEST_F(SolveOptionsOfTheCommand, TakesTheMethodAndTheLinearSolverThatItIsTold) {
  const std::string bal = data("problem-49-7776-pre.txt") + " --iterations 5";
  EXPECT_EQ(solve(bal + " --method dogleg")["method"], "dogleg");
  EXPECT_EQ(solve(bal + " --linear-solver cg")["linear_solver"], "landmark_schur+conjugate_gradient");
  EXPECT_EQ(solve(bal)["linear_solver"], "landmark_schur+dense");
  const CommandResult r = oriel("solve " + write("row.g2o", std::string(kRow) + kWrongLoop) + " --verbose");
  EXPECT_NE(r.out.find("max |gradient|"), std::string::npos) << r.out;
  EXPECT_NE(r.out.find("stages [ms]"), std::string::npos) << r.out;
}

TEST_F(SolveOptionsOfTheCommand, RefusesWhatDoesNotGoTogetherWithOneLine) {
  const std::string file = write("row.g2o", kRow), bal = data("problem-49-7776-pre.txt");
  for (const std::string& arguments :
       {file + " --covariance 9", file + " --covariance l1", file + " --covariance x", file + " --loss-on loops",
        file + " --gnc --loss huber:1", file + " --loss barron:1", file + " --loss barron:1:3",
        file + " --loss tukey:0", bal + " --loss-on loops --loss tukey:1", bal + " --init chordal"}) {
    const CommandResult r = oriel("solve " + arguments);
    EXPECT_EQ(r.exit_code, 2) << arguments;
    EXPECT_TRUE(r.out.empty()) << arguments;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << arguments << ": " << r.err;
  }
}

}  // namespace
}  // namespace oriel::apps
