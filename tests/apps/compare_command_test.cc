// oriel compare, and oriel solve --engine.
#include <gtest/gtest.h>

#include <cmath>

#include "apps/command_runner.h"

namespace oriel::apps {
namespace {

using nlohmann::json;

class CompareCommand : public CommandTest {
 protected:
  static bool has_ceres() { return std::filesystem::exists(std::string(ORIEL_COMMAND) + "-ceres"); }
};

// C8
TEST_F(CompareCommand, PutsTheEnginesSideBySideAndBoundsThePlanarPoseGraph) {
  const CommandResult r = oriel("compare " + data("intel.g2o") + " --json -");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const json o = r.json()[0];
  ASSERT_EQ(o["engines"].size(), 2u);
  const json &native = o["engines"][0], &ceres = o["engines"][1];
  EXPECT_EQ(native["engine"], "native");
  EXPECT_NEAR(native["final_cost"].get<double>(), 45.004696 / 2, 1e-6);
  if (has_ceres()) {
    EXPECT_NEAR(ceres["initial_cost"].get<double>(), native["initial_cost"].get<double>(), 1e-9);
    EXPECT_NEAR(ceres["final_cost"].get<double>(), native["final_cost"].get<double>(), 1e-6);
    EXPECT_GT(ceres["peak_rss_mb"].get<double>(), 1.0);
  } else {
    EXPECT_NE(ceres["error"].get<std::string>().find("built where Ceres is found"), std::string::npos);
  }
  const json& bound = o["global_optimum"];
  EXPECT_TRUE(bound["certified"].get<bool>());
  EXPECT_LE(bound["lower_bound"].get<double>(), bound["cost"].get<double>());
}

TEST_F(CompareCommand, AsksForNoCertificateOfLandmarks) {
  const std::string file =
      write("sight.g2o",
            "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_XY 2 1 1\nEDGE_SE2 0 1 1 0 0 4 0 0 4 0 4\n"
            "EDGE_SE2_XY 0 2 1 1 4 0 4\n");
  const CommandResult r = oriel("compare " + file);
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_NE(r.out.find("global optimum: not asked"), std::string::npos) << r.out;
}

TEST_F(CompareCommand, RefusesABadFileInOneLineBeforeAnyEngineRuns) {
  const CommandResult r = oriel("compare " + write("bad.g2o", "VERTEX_SE2 0 0 0\n") + " --json " + path("out.json"));
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  EXPECT_NE(r.err.find("bad.g2o:1:"), std::string::npos) << r.err;
  EXPECT_FALSE(std::filesystem::exists(path("out.json")));
}

TEST_F(CompareCommand, HasAnEngineThatSolveTakesByName) {
  const CommandResult r = oriel("solve " + data("intel.g2o") + " --engine ceres --json -");
  if (!has_ceres()) {
    EXPECT_EQ(r.exit_code, 2);
    return;
  }
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(r.json()[0]["linear_solver"], "ceres_sparse_cholesky");
  const CommandResult refused = oriel("solve " + data("intel.g2o") + " --engine ceres --linear-solver cg");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.err.find("the engine ceres has no conjugate gradients"), std::string::npos) << refused.err;
}

// C8
TEST_F(CompareCommand, HasEnginesOfWhichEitherGraduatesLossesAndGivesCovariances) {
  if (!has_ceres()) return;
  json o[2];
  for (const int k : {0, 1}) {
    const CommandResult r = oriel("solve " + data("intel.g2o") + " --gnc --covariance 7 --json - --engine " +
                                  (k == 0 ? "native" : "ceres"));
    ASSERT_EQ(r.exit_code, 0) << r.err;
    o[k] = r.json()[0];
  }
  EXPECT_EQ(o[0]["gnc"]["factors"], o[1]["gnc"]["factors"]);
  EXPECT_EQ(o[0]["gnc"]["outliers"], o[1]["gnc"]["outliers"]);
  EXPECT_NEAR(o[0]["final_cost"].get<double>(), o[1]["final_cost"].get<double>(), 1e-5);
  using Matrix = std::vector<std::vector<double>>;
  const auto a = o[0]["covariance"][0]["matrix"].get<Matrix>(), b = o[1]["covariance"][0]["matrix"].get<Matrix>();
  ASSERT_EQ(a.size(), 3u);
  ASSERT_EQ(b.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      EXPECT_NEAR(a[i][j], b[i][j], 1e-4 * std::sqrt(a[i][i] * a[j][j])) << i << ", " << j;
}

}  // namespace
}  // namespace oriel::apps
