#include "oriel/io/recording.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "oriel/io/euroc_import.h"
#include "oriel/io/text.h"

namespace oriel {
namespace {

namespace fs = std::filesystem;

const std::string kCamera =
    "%YAML:1.0\n# sensor\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n"
    "  data: [0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975,\n"
    "         0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768,\n"
    "        -0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949,\n"
    "         0.0, 0.0, 0.0, 1.0]\n"
    "rate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\nintrinsics: [458.654, 457.296, 367.215, 248.375] #fu\n"
    "distortion_model: radial-tangential\ndistortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76e-05]\n";
const std::string kImuSensor =
    "sensor_type: imu\nT_BS:\n  data: [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nrate_hz: 200\n"
    "gyroscope_noise_density: 1.6968e-04\ngyroscope_random_walk: 1.9393e-05\n"
    "accelerometer_noise_density: 2.0e-3\naccelerometer_random_walk: 3.0e-3\n";
const std::string kImu =
    "#timestamp [ns],w,w,w,a,a,a\r\n1403715273262142976,-0.002,0.017,0.07,9.08,0.13,-3.69\r\n"
    "1403715273267142912,0,0,0,9,0,-4\r\n";
const std::string kTracks =
    "#timestamp_ns,frame,track_id,u0,v0,u1,v1\n1403715273262142976,0,0,47.34,234.25,48.36,247.41\n"
    "1403715273262142976,0,5,83.56,64.28,,\n1403715273267142912,1,0,47,234,,\n";
const std::string kTruth = "# t\n1403715273.26214 0.8 2.1 0.9 -0.82 -0.10 -0.55 0.06\n1403715273.31214 1 2 3 0 0 0 1\n";

// A folder of its own for each test, gone at the end.
class RecordingFolder : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::path(testing::TempDir()) /
            ("oriel_recording_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(root_);
    fs::create_directories(root_ / "source");
    source("cam0_sensor.yaml", kCamera);
    source("cam1_sensor.yaml", kCamera.substr(kCamera.find('\n') + 1));
    source("imu0_sensor.yaml", kImuSensor);
    source("imu.csv", kImu);
    source("tracks.csv", kTracks);
    source("groundtruth.tum", kTruth);
  }
  void TearDown() override { fs::remove_all(root_); }

  void put(const fs::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }
  void source(const std::string& name, const std::string& text) { put(root_ / "source" / name, text); }
  std::string path(const std::string& name) { return (root_ / name).string(); }
  Result<Recording> import() { return import_euroc(path("source") + "/", path("made")); }
  // The message without the folder, and nothing may have been written.
  std::string import_error() {
    const auto recording = import();
    EXPECT_FALSE(fs::exists(path("made")));
    int entries = 0;
    for ([[maybe_unused]] const auto& entry : fs::directory_iterator(root_)) ++entries;
    EXPECT_EQ(entries, 1) << "the source alone";
    return recording ? "no error" : short_text(recording.error());
  }
  std::string short_text(const Error& error) {
    const std::string text = error.text();
    const std::size_t at = text.rfind('/', text.find(": "));
    return at == std::string::npos ? text : text.substr(at + 1);
  }
  fs::path root_;
};

TEST_F(RecordingFolder, IsImportedFromEurocAndReadBackToTheBit) {
  const auto made = import();
  ASSERT_TRUE(made) << made.error();
  const auto read = read_recording(path("made"));
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->name, "source");
  EXPECT_EQ(read->imu_noise.gyroscope_noise_density, 1.6968e-04);
  ASSERT_EQ(read->cameras.size(), 2u);
  EXPECT_EQ(read->cameras[0].width, 752);
  EXPECT_EQ(read->cameras[0].p2, 1.76e-05);
  for (int k = 0; k < 2; ++k) {
    const Mat3d& R = read->cameras[static_cast<std::size_t>(k)].R_body_camera;
    EXPECT_LT((R.transposed() * R - Mat3d::identity()).norm(), 1e-15);
    EXPECT_EQ(R, made->cameras[static_cast<std::size_t>(k)].R_body_camera);
  }
  EXPECT_NEAR(read->cameras[0].R_body_camera(0, 1), -0.999880929698, 1e-10);
  EXPECT_EQ(read->cameras[0].p_body_camera[1], -0.064676986768);
  ASSERT_EQ(read->imu.size(), 2u);
  EXPECT_EQ(read->imu[0].time.ns, 1403715273262142976);
  EXPECT_EQ(read->imu[0].accel, (Vec3d{9.08, 0.13, -3.69}));
  ASSERT_EQ(read->frames.size(), 2u);
  const auto rows = read->observations_of(read->frames[0]);
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_TRUE(rows[0].has_right);
  EXPECT_EQ(rows[0].v1, 247.41);
  EXPECT_FALSE(rows[1].has_right);
  EXPECT_EQ(rows[1].track_id, 5);
  ASSERT_EQ(read->groundtruth.size(), 2u);
  EXPECT_EQ(read->groundtruth[0].time.ns, 1403715273262140000);
}

TEST_F(RecordingFolder, NeedsNeitherGroundTruthNorASecondCamera) {
  fs::remove(path("source/groundtruth.tum"));
  fs::remove(path("source/cam1_sensor.yaml"));
  EXPECT_EQ(import_error(), "tracks.csv:2: track row 0: expected no u1,v1, as the calibration has one camera");
  source("tracks.csv", "1403715273262142976,0,0,47.34,234.25,,\n");
  ASSERT_TRUE(import());
  const auto read = read_recording(path("made"));
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->cameras.size(), 1u);
  EXPECT_TRUE(read->groundtruth.empty());
}

TEST_F(RecordingFolder, NamesTheImuSampleThatIsWrong) {
  source("imu.csv", kImu + "1403715273267142912,0,0,0,9,0,-4\n");
  EXPECT_EQ(import_error(),
            "imu.csv:4: IMU sample 2: expected a later stamp than 1403715273267142912, found 1403715273267142912 "
            "(duplicate)");
  source("imu.csv", kImu + "1403715273267142911,0,0,0,9,0,-4\n");
  EXPECT_EQ(
      import_error(),
      "imu.csv:4: IMU sample 2: expected a later stamp than 1403715273267142912, found 1403715273267142911 (backward)");
  source("imu.csv", kImu + "1403715273272142912,0,0,nan,9,0,-4\n");
  EXPECT_EQ(import_error(), "imu.csv:4: IMU sample 2: expected a finite number for wz, found 'nan'");
  source("imu.csv", kImu + "1403715273272142912,0,0,0,9,0\n");
  EXPECT_EQ(import_error(), "imu.csv:4: IMU sample 2: expected 7 columns timestamp_ns,wx,wy,wz,ax,ay,az, found 6");
  source("imu.csv", kImu + "1.4e18,0,0,0,9,0,0\n");
  EXPECT_EQ(import_error(), "imu.csv:4: IMU sample 2: expected an integer for timestamp_ns, found '1.4e18'");
  source("imu.csv", "#t\n");
  EXPECT_EQ(import_error(), "imu.csv: IMU: expected samples, found none");
}

TEST_F(RecordingFolder, NamesTheTrackRowThatIsWrong) {
  source("tracks.csv", kTracks + "1403715273267142912,1,0,1,1,,\n");
  EXPECT_EQ(import_error(),
            "tracks.csv:5: track row 3: expected each track once a frame, found track 0 again in frame 1");
  source("tracks.csv", kTracks + "1403715273262142976,0,9,1,1,,\n");
  EXPECT_EQ(
      import_error(),
      "tracks.csv:5: track row 3: expected frames in rising order, found frame 0 at 1403715273262142976 ns after frame "
      "1 at 1403715273267142912 ns");
  source("tracks.csv", kTracks + "1403715273267142913,1,9,1,1,,\n");
  EXPECT_NE(import_error().find("expected one stamp for each frame number"), std::string::npos);
  source("tracks.csv", kTracks + "1403715273267142912,1,9,1,1,5,\n");
  EXPECT_EQ(import_error(), "tracks.csv:5: track row 3: expected a finite number for v1, found the end of the line");
}

TEST_F(RecordingFolder, NamesTheKeyOfASensorFileThatIsWrong) {
  const auto camera = [&](const std::string& from, const std::string& to) {
    std::string text = kCamera;
    source("cam0_sensor.yaml", text.replace(text.find(from), from.size(), to));
    return import_error();
  };
  EXPECT_EQ(camera("camera_model: pinhole", "camera_model: omni"),
            "cam0_sensor.yaml:13: cam0: expected camera_model pinhole, found 'omni'");
  EXPECT_EQ(camera("intrinsics: [458.654, ", "intrinsics: ["),
            "cam0_sensor.yaml:14: cam0: expected a list of 4 finite numbers for `intrinsics`, found 3");
  EXPECT_EQ(camera("458.654", "nan"),
            "cam0_sensor.yaml:14: cam0: expected a list of 4 finite numbers for `intrinsics`, found 'nan'");
  EXPECT_EQ(camera("resolution", "size"), "cam0_sensor.yaml:3: cam0: expected the key `resolution`, found none");
  EXPECT_EQ(camera("[0.0148655429818", "[1.0148655429818"),
            "cam0_sensor.yaml:5: cam0: expected a rotation and a translation");
  EXPECT_NE(camera("[752", "[[752").find("expected YAML"), std::string::npos);
  source("cam0_sensor.yaml", "");
  EXPECT_NE(import_error().find("expected a map of keys and values"), std::string::npos);
  fs::remove(path("source/cam0_sensor.yaml"));
  EXPECT_NE(import_error().find("cam0_sensor.yaml: cannot be opened"), std::string::npos);
}

TEST_F(RecordingFolder, RefusesToOverwriteWhatIsNoRecording) {
  fs::create_directories(path("made"));
  put(path("made/thesis.tex"), "precious");
  const auto refused = import();
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("not overwritten"), std::string::npos);
  EXPECT_TRUE(fs::exists(path("made/thesis.tex")));
  fs::remove(path("made/thesis.tex"));
  ASSERT_TRUE(import()) << "into an empty folder";
  fs::remove(path("source/groundtruth.tum"));
  ASSERT_TRUE(import()) << "over a recording";
  EXPECT_FALSE(fs::exists(path("made/groundtruth.tum"))) << "nothing of the old one is left";
  put(path("made/notes.txt"), "mine");
  EXPECT_FALSE(import()) << "a recording with something else in it";
}

TEST_F(RecordingFolder, SaysWhichKeyOfTheIndexIsMissingOrUnknown) {
  ASSERT_TRUE(import());
  const std::string index = read_text_file(path("made/recording.yaml")).value();
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = index;
    put(path("made/recording.yaml"), text.replace(text.find(from), from.size(), to));
    const auto read = read_recording(path("made"));
    return read ? "no error" : short_text(read.error());
  };
  EXPECT_EQ(with("oriel-recording/1", "oriel-recording/9"),
            "recording.yaml:1: recording: expected format oriel-recording/1, found 'oriel-recording/9'");
  EXPECT_EQ(with("name: ", "nome: "),
            "recording.yaml:2: recording: unknown key 'nome'; expected format, name, origin, files, imu, cameras");
  EXPECT_EQ(with("  rate_hz: 200", "  rate_hz: -1"), "recording.yaml:9: imu: expected a positive number for `rate_hz`");
  EXPECT_EQ(with("  tracks: tracks.csv\n", ""), "recording.yaml:5: files: expected the key `tracks`, found none");
  EXPECT_EQ(with("pinhole-radtan", "fisheye"), "recording.yaml:15: camera 0: expected pinhole-radtan, found 'fisheye'");
  EXPECT_EQ(with("imu.csv", "gone.csv"), "gone.csv: cannot be opened: No such file or directory");
  EXPECT_NE(read_recording(path("nowhere")).error().text().find("found no such folder"), std::string::npos);
}

}  // namespace
}  // namespace oriel
