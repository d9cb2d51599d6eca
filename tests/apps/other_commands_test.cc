// The command line as a whole, `oriel evaluate` and `oriel import`.
#include "command_runner.h"

namespace oriel::apps {
namespace {

using nlohmann::json;
using Command = CommandTest;
using EvaluateCommand = CommandTest;
using ImportCommand = CommandTest;

constexpr const char* kLine =
    "1.4e+09 0 0 0 0 0 0 1\n1400000001 1 0 0 0 0 0 1\n1400000002 2 1 0 0 0 0 1\n1400000003.5 3 0 2 0 0 0 1\n";

TEST_F(Command, ExplainsItselfAndEndsWithZero) {
  for (const std::string arguments : {"--help", "--version", "solve --help", "import --help", "evaluate --help"}) {
    const CommandResult r = oriel(arguments);
    EXPECT_EQ(r.exit_code, 0) << arguments;
    EXPECT_FALSE(r.out.empty()) << arguments;
  }
}

TEST_F(Command, NamesTheSubcommandThatItDoesNotKnow) {
  const CommandResult r = oriel("frobnicate --json -");
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_TRUE(r.out.empty());
  EXPECT_NE(r.err.find("'frobnicate'"), std::string::npos) << r.err;
  EXPECT_NE(r.err.find("solve"), std::string::npos) << r.err;
  EXPECT_EQ(oriel("").exit_code, 2);
}

TEST_F(EvaluateCommand, FindsNoErrorInTheTruthItself) {
  const std::string truth = write("truth.tum", kLine);
  const CommandResult r = oriel("evaluate " + truth + " " + truth + " --json -");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(r.json()["pairs"], 4);
  EXPECT_NEAR(r.json()["ate_m"].get<double>(), 0.0, 1e-9);
  EXPECT_DOUBLE_EQ(r.json()["duration_s"].get<double>(), 3.5);
}

// W1
TEST_F(EvaluateCommand, ReadsStampsExactlyToTheNanosecond) {
  const std::string truth = write("truth.tum", kLine);
  const std::string late = write("late.tum",
                                 "1400000000.000000001 0 0 0 0 0 0 1\n1400000001.000000001 1 0 0 0 0 0 1\n"
                                 "1400000002.000000002 2 1 0 0 0 0 1\n1400000003.5 3 0 2 0 0 0 1\n");
  EXPECT_EQ(oriel("evaluate " + late + " " + truth + " --max-dt 1e-9 --json -").json()["pairs"], 3);
  EXPECT_EQ(oriel("evaluate " + late + " " + truth + " --max-dt 2e-9 --json -").json()["pairs"], 4);
}

TEST_F(EvaluateCommand, MovesTheEstimateByWhatIsAllowedAlone) {
  const std::string truth = write("truth.tum", kLine);
  const std::string shifted = write("shifted.tum",
                                    "1400000000 0 0 5 0 0 0 1\n1400000001 2 0 5 0 0 0 1\n"
                                    "1400000002 4 2 5 0 0 0 1\n1400000003.5 6 0 9 0 0 0 1\n");
  const auto ate = [&](const std::string& align) {
    return oriel("evaluate " + shifted + " " + truth + " --align " + align + " --json -").json()["ate_m"].get<double>();
  };
  EXPECT_NEAR(ate("sim3"), 0.0, 1e-9);
  EXPECT_GT(ate("se3"), 0.1);
  EXPECT_GT(ate("yaw"), 0.1);
  EXPECT_GT(ate("none"), 5.0);
}

TEST_F(EvaluateCommand, RefusesFilesThatHaveNoPairOrAreNone) {
  const std::string truth = write("truth.tum", kLine), other = write("other.tum", "5 0 0 0 0 0 0 1\n");
  for (const std::string& arguments :
       {other + " " + truth, truth + " " + path("absent.tum"), truth + " " + write("bad.tum", "1 2 3\n"),
        truth + " " + truth + " --align moon"}) {
    const CommandResult r = oriel("evaluate " + arguments + " --json -");
    EXPECT_EQ(r.exit_code, 2) << arguments;
    EXPECT_TRUE(r.out.empty()) << r.out;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  }
}

TEST_F(ImportCommand, MakesARecordingAndMakesItAgain) {
  for (int i = 0; i < 2; ++i) {
    const CommandResult r = oriel("import " + data("euroc_v101") + " " + path("recording"));
    ASSERT_EQ(r.exit_code, 0) << r.err;
    EXPECT_NE(r.out.find("100 frames"), std::string::npos) << r.out;
  }
  EXPECT_TRUE(std::filesystem::exists(path("recording") + "/recording.yaml"));
}

TEST_F(ImportCommand, LeavesAFolderAloneThatIsNoRecording) {
  std::filesystem::create_directory(path("precious"));
  write("precious/letter.txt", "dear");
  const CommandResult r = oriel("import " + data("euroc_v101") + " " + path("precious"));
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_EQ(read(path("precious/letter.txt")), "dear");
  EXPECT_FALSE(std::filesystem::exists(path("precious/recording.yaml")));
}

TEST_F(ImportCommand, WritesNothingForASourceThatIsNone) {
  const CommandResult r = oriel("import " + path("absent") + " " + path("recording"));
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  EXPECT_FALSE(std::filesystem::exists(path("recording")));
}

}  // namespace
}  // namespace oriel::apps
