// `oriel run` and `oriel replay` on the project's own recording.
#include "command_runner.h"

namespace oriel::apps {
namespace {

using nlohmann::json;

class RunCommand : public CommandTest {
 protected:
  std::string recording() const {
    EXPECT_EQ(oriel("import " + data("euroc_v101") + " " + path("recording")).exit_code, 0);
    return path("recording");
  }
};

TEST_F(RunCommand, EstimatesTheWholeFlightAndReportsEveryKeyOfItsContract) {
  const CommandResult r = oriel("run " + recording() + " --json - --out " + path("flight.tum"));
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const json o = r.json();
  ASSERT_TRUE(o.is_object()) << r.out;
  for (const char* key : {"recording", "duration_s", "states", "updates", "solves_refused", "frames_per_second",
                          "update_ms", "initialised_after_s", "coverage", "ate_m", "ate_final_m", "ate_deg", "path_m",
                          "dropped", "allocations_per_update", "peak_rss_mb", "warnings"})
    EXPECT_TRUE(o.contains(key)) << key;
  for (const char* key : {"p50", "p99", "p999", "max"}) EXPECT_GT(o["update_ms"][key].get<double>(), 0.0) << key;
  EXPECT_EQ(o["updates"], 100);
  EXPECT_GE(o["coverage"].get<double>(), 0.98);
  EXPECT_LE(o["ate_m"].get<double>(), 0.10);
  // The trajectory that was written is the one that was judged.
  const json judged =
      oriel("evaluate " + path("flight.tum") + " " + data("euroc_v101") + "/groundtruth.tum --json -").json();
  EXPECT_NEAR(judged["ate_m"].get<double>(), o["ate_m"].get<double>(), 1e-6);
}

TEST_F(RunCommand, TakesLandmarksAsItIsTold) {
  const auto ate = [&](const std::string& landmarks) {
    const CommandResult r = oriel("run " + path("recording") + landmarks + " --json -");
    EXPECT_EQ(r.exit_code, 0) << r.err;
    return r.json()["ate_m"].get<double>();
  };
  (void)recording();
  EXPECT_LE(ate(" --landmarks inverse-depth"), 0.05);
  EXPECT_LE(ate(" --landmarks point"), 0.04);
  EXPECT_EQ(ate(""), ate(" --landmarks point"));
  EXPECT_EQ(oriel("run " + path("recording") + " --landmarks balloon").exit_code, 2);
}

// C8
TEST_F(RunCommand, FliesAboutTheSameWayWithTheOtherEngine) {
  if (!std::filesystem::exists(std::string(ORIEL_COMMAND) + "-ceres")) return;
  const std::string flight = "run " + recording() + " --json - --engine ";
  const CommandResult native = oriel(flight + "native --out " + path("native.tum"));
  const CommandResult ceres = oriel(flight + "ceres --out " + path("ceres.tum"));
  ASSERT_EQ(ceres.exit_code, 0) << ceres.err;
  EXPECT_EQ(ceres.json()["states"], native.json()["states"]);
  EXPECT_NEAR(ceres.json()["ate_m"].get<double>(), native.json()["ate_m"].get<double>(), 0.01);
  // The one trajectory as the other's truth, not aligned.
  const json apart =
      oriel("evaluate " + path("ceres.tum") + " " + path("native.tum") + " --align none --json -").json();
  EXPECT_EQ(apart["pairs"], native.json()["states"]);
  EXPECT_LT(apart["position_m"]["max"].get<double>(), 0.02);
  EXPECT_GT(apart["position_m"]["max"].get<double>(), 0.0);  // it was another engine
  const CommandResult journal = oriel(flight + "ceres --journal " + path("ceres.journal"));
  EXPECT_EQ(journal.exit_code, 2);
  EXPECT_NE(journal.err.find("--journal: expected --engine native"), std::string::npos) << journal.err;
  EXPECT_FALSE(std::filesystem::exists(path("ceres.journal")));
}

// The program with Ceres is linked with a BLAS, which may have threads before main has begun: no process is forked
// then.
TEST_F(RunCommand, SaysWhatToDoWhereALibraryHasMadeThreads) {
  if (!std::filesystem::exists(std::string(ORIEL_COMMAND) + "-ceres")) return;
  const std::string run = ORIEL_COMMAND "-ceres run " + recording() + " --executor process --json -";
  const CommandResult one = shell("OPENBLAS_NUM_THREADS=1 " + run);
  EXPECT_EQ(one.exit_code, 0) << one.err;
  const CommandResult many = shell("OPENBLAS_NUM_THREADS=2 " + run);
  if (many.exit_code == 0) return;  // another BLAS, or one core
  EXPECT_EQ(many.exit_code, 2);
  EXPECT_EQ(std::count(many.err.begin(), many.err.end(), '\n'), 1) << many.err;
  EXPECT_NE(many.err.find("is told not to by OPENBLAS_NUM_THREADS=1)"), std::string::npos) << many.err;
}

// W17
TEST_F(RunCommand, WarnsOfAWindowThatBeganAnewWithItsReason) {
  ASSERT_EQ(oriel("simulate " + path("flight") +
                  " --seconds 12 --camera-rate 10 --tracks 60 --fault dropout:imu:6:7 "
                  "--fault outlier:camera:6:7:1")
                .exit_code,
            0);
  const CommandResult r = oriel("run " + path("flight") + " --json -");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  bool named = false;
  const json report = r.json();
  for (const json& w : report["warnings"])
    named = named ||
            w.get<std::string>().find("the window began anew: no IMU samples, and too little that is known in view") !=
                std::string::npos;
  EXPECT_TRUE(named) << report["warnings"];
}

// L10
TEST_F(RunCommand, ReplaysItsJournalToTheSameBitsWithCachesDroppedAndTwoThreads) {
  ASSERT_EQ(oriel("run " + recording() + " --journal " + path("flight.journal")).exit_code, 0);
  const CommandResult r = oriel("replay " + path("flight.journal") + " --verify --drop-caches --threads 2");
  EXPECT_EQ(r.exit_code, 0) << r.out << r.err;
}

// What is there is solved again and compared; then where the damage is.
TEST_F(RunCommand, VerifiesAJournalUpToWhereItIsCutOrDamaged) {
  ASSERT_EQ(oriel("run " + recording() + " --journal " + path("flight.journal")).exit_code, 0);
  std::ifstream in(path("flight.journal"), std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  std::string damaged = whole;
  damaged[whole.size() / 2] = static_cast<char>(damaged[whole.size() / 2] ^ 1);
  for (const std::string& bytes : {whole.substr(0, whole.size() / 2), damaged}) {
    std::ofstream(path("half.journal"), std::ios::binary) << bytes;
    const CommandResult r = oriel("replay " + path("half.journal") + " --verify");
    EXPECT_EQ(r.exit_code, 2);
    EXPECT_NE(r.out.find("solved again: the same bits after every solve"), std::string::npos) << r.out;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_NE(r.err.find("before it are whole"), std::string::npos) << r.err;
  }
}

TEST_F(RunCommand, RefusesWhatIsNoRecordingWithOneLine) {
  const CommandResult r = oriel("run " + path("absent") + " --json - --out " + path("flight.tum"));
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_TRUE(r.out.empty()) << r.out;
  EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  EXPECT_FALSE(std::filesystem::exists(path("flight.tum")));
}

}  // namespace
}  // namespace oriel::apps
