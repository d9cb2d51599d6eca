// Folders of stereo tracks without an IMU become recordings.
#include "oriel/io/stereo_import.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

namespace oriel {
namespace {

namespace fs = std::filesystem;

const std::string kCalibration =
    "# rectified\nfu: 700.0\nfv: 710.0\ncu: 600.0\ncv: 170.0\nbaseline_m: 0.5\n"
    "T_VC: [0, 0, 1, 1.5, -1, 0, 0, 0.25, 0, -1, 0, 0.75, 0, 0, 0, 1]\n";
const std::string kTracks =
    "#timestamp_ns,frame,track_id,u_left,v_left,u_right,v_right\n"
    "1317042145967803000,0,0,343.5,22.75,335.25,22.5\n1317042145967803000,0,4,1,2,0.5,2\n"
    "1317042146070900000,1,4,3,4,2,4\n";

class StereoImport : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::path(testing::TempDir()) /
            ("oriel_stereo_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(root_);
    fs::create_directories(root_ / "source");
    put("calib.yaml", kCalibration);
    put("tracks.csv", kTracks);
    put("groundtruth.tum", "# t\n1317042145.967803000 0 0 0 0 0 0 1\n1317042146.070900000 1 0 0 0 0 0 1\n");
  }
  void TearDown() override { fs::remove_all(root_); }
  void put(const std::string& name, const std::string& text) {
    std::ofstream(root_ / "source" / name, std::ios::binary) << text;
  }
  std::string source() const { return (root_ / "source").string(); }
  // The message without the folder.
  std::string fault() {
    const auto read = read_any_recording(source());
    if (read) return "";
    std::string text = read.error().text();
    if (const std::size_t at = text.find(source() + "/"); at == 0) text.erase(0, source().size() + 1);
    return text;
  }
  fs::path root_;
};

TEST_F(StereoImport, PutsTheRightCameraABaselineAlongTheLeftOnesRows) {
  const auto r = read_any_recording(source() + "/");
  ASSERT_TRUE(r) << r.error();
  ASSERT_EQ(r->cameras.size(), 2u);
  EXPECT_EQ(r->cameras[1].fy, 710.0);
  EXPECT_EQ(r->cameras[0].p_body_camera, (Vec3d{{1.5, 0.25, 0.75}}));
  EXPECT_EQ(r->cameras[1].p_body_camera, (Vec3d{{1.5, -0.25, 0.75}}));  // the camera's x is the body's -y
  EXPECT_EQ(r->cameras[1].R_body_camera, r->cameras[0].R_body_camera);
  EXPECT_EQ(r->frames.size(), 2u);
  EXPECT_EQ(r->observations[0].u1, 335.25);
  EXPECT_EQ(r->groundtruth.size(), 2u);
  EXPECT_TRUE(r->imu.empty());
  EXPECT_EQ(r->cameras[0].pixel_sigma, Vec2d::zero());  // not known
}

TEST_F(StereoImport, KeepsTheNoiseOfPixelsAndNeedsNoTruth) {
  put("calib.yaml", kCalibration + "pixel_variance_px2: [36, 121, 49, 144]\ngyro_variance_rad2_s2: [1, 2, 3]\n");
  fs::remove(root_ / "source" / "groundtruth.tum");
  const auto r = read_stereo_tracks(source());
  ASSERT_TRUE(r) << r.error();
  EXPECT_EQ(r->cameras[0].pixel_sigma, (Vec2d{{6.0, 11.0}}));
  EXPECT_EQ(r->cameras[1].pixel_sigma, (Vec2d{{7.0, 12.0}}));
  EXPECT_TRUE(r->groundtruth.empty());
}

// A recording without an IMU, with cameras whose size nobody said.
TEST_F(StereoImport, BecomesARecordingThatReadsBackTheSame) {
  put("calib.yaml", kCalibration + "pixel_variance_px2: [36, 121, 49, 144]\n");
  const auto r = read_any_recording(source());
  ASSERT_TRUE(r) << r.error();
  const std::string made = (root_ / "made").string();
  ASSERT_TRUE(write_recording(made, *r));
  EXPECT_FALSE(fs::exists(root_ / "made" / "imu.csv"));
  const auto back = read_any_recording(made);
  ASSERT_TRUE(back) << back.error();
  EXPECT_EQ(back->cameras[1].p_body_camera, r->cameras[1].p_body_camera);
  EXPECT_EQ(back->cameras[1].pixel_sigma, r->cameras[1].pixel_sigma);
  EXPECT_EQ(back->cameras[0].R_body_camera, r->cameras[0].R_body_camera);
  EXPECT_EQ(back->observations.size(), 3u);
  EXPECT_EQ(back->frames[1].time, r->frames[1].time);
  EXPECT_TRUE(back->imu.empty());
  // Half an IMU is a fault.
  std::ofstream(root_ / "made" / "recording.yaml", std::ios::app)
      << "imu: {rate_hz: 1, gyroscope_noise_density: 1, gyroscope_random_walk: 1, accelerometer_noise_density: 1, "
         "accelerometer_random_walk: 1}\n";
  const auto half = read_recording(made);
  ASSERT_FALSE(half);
  EXPECT_NE(half.error().message.find("expected the noise `imu` and the file `files.imu` both, or neither"),
            std::string::npos)
      << half.error();
}

TEST_F(StereoImport, NamesFileAndLineOfWhatIsWrong) {
  const auto spoilt = [&](const std::string& from, const std::string& to) {
    std::string text = kCalibration;
    text.replace(text.find(from), from.size(), to);
    put("calib.yaml", text);
    return fault();
  };
  EXPECT_EQ(spoilt("fv: 710.0\n", "fv: -1\n").find("calib.yaml:3: "), 0u);
  EXPECT_EQ(spoilt("baseline_m", "base").find("calib.yaml:"), 0u);
  EXPECT_NE(spoilt("-1, 0, 0, 0.25", "-1, 0.5, 0, 0.25")
                .find("expected a rotation, a translation and a last row of 0, 0, 0, 1"),
            std::string::npos);
  EXPECT_NE(spoilt("0, 0, 0, 1]", "0, 0, 1, 1]").find("expected a rotation"), std::string::npos);
  put("calib.yaml", kCalibration + "pixel_variance_px2: [36, 121, 0, 144]\n");
  EXPECT_EQ(fault().find("calib.yaml:8: "), 0u);
  put("calib.yaml", kCalibration);
  put("tracks.csv", "1,0,0,343.5,22.75,335.25\n");
  EXPECT_EQ(fault(), "tracks.csv:1: track row 0: expected 7 columns timestamp_ns,frame,track_id,u0,v0,u1,v1, found 6");
  fs::remove(root_ / "source" / "calib.yaml");
  EXPECT_NE(fault().find("expected a folder with recording.yaml, calib.yaml (stereo tracks), cam0_sensor.yaml"),
            std::string::npos);
  EXPECT_FALSE(read_any_recording("/nonexistent"));
}

TEST_F(StereoImport, ReadsTheStereoExampleOfGtsamByPosesWhateverTheOrderOfItsLines) {
  fs::remove(root_ / "source" / "calib.yaml");
  put("VO_calibration00s.txt", "700 710 0.0 600 170 0.5");
  put("VO_stereo_factors00s.txt", "0 7 322.5 299.5 11 -6 -4 16\n2 7 313 289 7 -6 -3 16\n0 3 1 2 3 4 5 6\n");
  put("VO_camera_poses00s.txt", "0  1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1\n2  0 0 1 3  0 1 0 2  -1 0 0 1  0 0 0 1\n");
  const auto r = read_any_recording(source());
  ASSERT_TRUE(r) << r.error();
  EXPECT_EQ(r->cameras[1].p_body_camera, (Vec3d{{0.5, 0.0, 0.0}}));
  ASSERT_EQ(r->frames.size(), 2u);
  EXPECT_EQ(r->frames[1].time, Time{200'000'000});
  EXPECT_EQ(r->observations[0].track_id, 3);
  EXPECT_EQ(r->observations[1].u1, 299.5);
  EXPECT_EQ(r->observations[1].v1, 11.0);
  ASSERT_EQ(r->groundtruth.size(), 2u);
  EXPECT_EQ(r->groundtruth[1].p, (Vec3d{{3.0, 2.0, 1.0}}));
  EXPECT_NEAR(r->groundtruth[1].qy, std::sqrt(0.5), 1e-12);
  put("VO_stereo_factors00s.txt", "0 7 322.5 299.5 11 -6 -4\n");
  EXPECT_EQ(fault(),
            "VO_stereo_factors00s.txt:1: expected a finite number for the sighting, found the end of the line");
  put("VO_stereo_factors00s.txt", "0 7 1 2 3 4 5 6\n0 7 1 2 3 4 5 6\n");
  EXPECT_EQ(fault().find("VO_stereo_factors00s.txt:2: expected each landmark once a pose"), 0u);
  put("VO_calibration00s.txt", "700 710 0.1 600 170 0.5");
  EXPECT_EQ(fault().find("VO_calibration00s.txt:1: expected positive focal lengths and baseline, and no skew"), 0u);
}

}  // namespace
}  // namespace oriel
