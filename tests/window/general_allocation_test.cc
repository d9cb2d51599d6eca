// Memory that a general window asks for once it is full and has seen all that it will see: none, with every builder
// that is shipped, and with a gate that asks for covariances.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

#include "oriel/residual/prior.h"
#include "oriel/testing/allocation_counter.h"
#include "oriel/window/cheirality_hook.h"
#include "oriel/window/late_fusion.h"
#include "oriel/window/mahalanobis_gate.h"
#include "oriel/window/odometry_provider.h"
#include "oriel/window/sensor_builder.h"
#include "oriel/window/sliding_window.h"
#include "oriel/window/structureless_builder.h"
#include "oriel/window/track_builder.h"
#include "residual/random_values.h"

namespace oriel {
namespace {

// A corridor that repeats every 20 frames, so that a window has seen its largest after some rounds.
class Corridor {
 public:
  static constexpr int kRound = 20, kPoints = 50;
  static constexpr double kStep = 0.2;  // [m] a frame
  StereoRigd rig = testing_values::euroc_like_rig();

  Corridor() {
    std::mt19937 random(5);
    auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
    for (int i = 0; i < kPoints; ++i)
      points_.push_back({{uniform(0.0, kRound * kStep), uniform(-1.5, 1.5), uniform(2.5, 5.0)}});
    for (int phase = 0; phase < kRound; ++phase) look(phase);
  }
  static Time time(int k) { return {100'000'000LL * k}; }
  static Pose3d pose(int k) {
    const double a = 2.0 * 3.14159265358979 * (k % kRound) / kRound;
    return {Rot3d::exp({{0.02 * std::sin(a), 0.03 * std::cos(a), 0.02 * std::sin(a)}}),
            {{kStep * k, 0.1 * std::sin(a), 0.05 * std::cos(a)}}};
  }
  // Tracks have other numbers in every round.
  void frame(int k, std::vector<FeatureObservation>& out) const {
    out.assign(seen_[k % kRound].begin(), seen_[k % kRound].end());
    for (FeatureObservation& f : out) f.track += kPoints * (k / kRound);
  }

 private:
  void look(int phase) {
    auto& seen = seen_.emplace_back();
    std::mt19937 random(static_cast<unsigned>(100 + phase));
    std::normal_distribution<double> noise(0.0, 0.5);
    for (int cell = -2; cell <= 2; ++cell)
      for (int i = 0; i < kPoints; ++i) {
        const Vec3d p = points_[i] + Vec3d{{cell * kRound * kStep, 0.0, 0.0}};
        FeatureObservation f;
        f.track = i + kPoints * cell;
        if (!project(0, phase, p, f.pixel0)) continue;
        f.has_right = i % 2 == 0 && project(1, phase, p, f.pixel1);
        for (Vec2d* pixel : {&f.pixel0, &f.pixel1}) *pixel += Vec2d{{noise(random), noise(random)}};
        seen.push_back(f);
      }
  }
  bool project(int camera, int phase, const Vec3d& p, Vec2d& pixel) const {
    const auto& mount = rig.cameras[camera];
    const Vec3d h = mount.T_body_camera().inverse() * (pose(phase).inverse() * p);
    return h[2] > 0.5 && std::hypot(h[0], h[1]) < 0.8 * h[2] && mount.camera.project(h, pixel, nullptr) &&
           pixel[0] > 5 && pixel[0] < 747 && pixel[1] > 5 && pixel[1] < 475;
  }
  std::vector<Vec3d> points_;
  std::vector<std::vector<FeatureObservation>> seen_;
};

using Fixes = SensorBuilder<Prior<Pose3d>, IsotropicNoise>;

struct Full {
  const Corridor& corridor;
  SlidingWindow window;
  OdometryProvider<Pose3d>* odometry = nullptr;
  Fixes* fixes = nullptr;
  MahalanobisGate* gate = nullptr;
  Function<void(const StereoFrame&)> add_frame;
  ProviderId poses;
  VariableId<StereoRigd> rig;
  std::vector<FeatureObservation> features;

  Full(const Corridor& c, LandmarkPolicy landmarks) : corridor(c), window(options(landmarks)) {
    auto provider = std::make_unique<OdometryProvider<Pose3d>>(Corridor::pose(0), Mat6d::identity() * 1e-6);
    odometry = provider.get();
    odometry->start_measuring(Corridor::time(0));
    poses = window.add(std::move(provider));
    auto lag = std::make_unique<LagPolicy>();
    EXPECT_TRUE(lag->set({1, 8, {}}).ok());
    window.set(std::move(lag));
    rig = window.core().edit().add(corridor.rig);
    EXPECT_TRUE(window.core().commit().ok());
    auto sensor = std::make_unique<Fixes>("fix", poses);
    fixes = sensor.get();
    const int number = window.add(std::move(sensor));
    auto hook = std::make_unique<MahalanobisGate>(window.core().followed());
    gate = hook.get();
    EXPECT_TRUE(gate->set(number, {.probability = 0.999, .with_covariance = true, .rejects_group = true}).ok());
    window.add(std::move(hook));
    window.add(std::make_unique<CheiralityHook>());
    features.reserve(1000);
  }
  static WindowOptions options(LandmarkPolicy landmarks) {
    WindowOptions o;
    o.solve.max_iterations = 5;
    o.marginalize.landmarks = landmarks;
    return o;
  }
  // Frames, and now and then a fix between two of them, so that their motion is split; some are gross errors.
  void step(int k) {
    if (k > 0) {
      const Pose3d moved = Corridor::pose(k - 1).inverse() * Corridor::pose(k);
      EXPECT_TRUE(odometry->add(Corridor::time(k), moved, Mat6d::identity() * 1e-4).ok());
    }
    corridor.frame(k, features);
    add_frame({Corridor::time(k), features});
    if (k % 4 == 2) {
      Pose3d fix = Corridor::pose(k);
      if (k % 10 == 0) fix.t[1] += 30.0;
      fixes->add(Corridor::time(k), Prior{fix}, Sigma(0.05));
    }
    if (k % 5 == 3) fixes->add(Corridor::time(k) - Duration{50'000'000}, Prior{Corridor::pose(k)}, Sigma(0.5));
    ASSERT_EQ(window.update().status, WindowUpdate::Status::updated) << window.last_update().error;
  }
};

// Of so many updates after the first rounds.
void expect_none(Full& full, int updates = 500) {
  if (!counts_allocations()) GTEST_SKIP() << "a sanitizer has an operator new of its own";
  constexpr int kFirst = 3 * Corridor::kRound;
  std::int64_t all = 0;
  int with = 0, last = 0;
  for (int k = 0; k < kFirst + updates; ++k) {
    const std::int64_t before = allocation_count();
    full.step(k);
    const std::int64_t n = allocation_count() - before;
    if (n > 0) last = k;
    if (k >= kFirst) all += n, with += n > 0 ? 1 : 0;
  }
  EXPECT_EQ(all, 0) << "in " << with << " updates, the last of them " << last;
  EXPECT_GE(full.gate->rejected(), updates / Corridor::kRound);
  EXPECT_EQ(full.window.states().timeline(full.poses).size(), 8u);
}

// W14
TEST(GeneralAllocation, IsNoneWithStructurelessTracks) {
  const Corridor corridor;
  for (const auto leaving : {StructurelessOptions::Leaving::absorb, StructurelessOptions::Leaving::landmark}) {
    Full full(corridor,
              leaving == StructurelessOptions::Leaving::landmark ? LandmarkPolicy::keep : LandmarkPolicy::close);
    StructurelessOptions options;
    options.leaving = leaving;
    auto builder = std::make_unique<StructurelessBuilder>(full.poses, corridor.rig, full.rig, options);
    StructurelessBuilder* tracks = builder.get();
    full.add_frame = [tracks](const StereoFrame& f) { tracks->add(f); };
    full.window.add(std::move(builder));
    expect_none(full, leaving == StructurelessOptions::Leaving::landmark ? 100 : 500);
    EXPECT_GT(tracks->factors(), 10);
  }
}

// W14
TEST(GeneralAllocation, IsNoneWithLandmarks) {
  const Corridor corridor;
  for (const auto kind : {LandmarkKind::inverse_depth, LandmarkKind::point}) {
    Full full(corridor, LandmarkPolicy::close);
    TrackBuilderOptions options;
    options.landmarks = kind;
    auto builder = std::make_unique<TrackBuilder>(full.poses, corridor.rig, full.rig, options);
    TrackBuilder* tracks = builder.get();
    full.add_frame = [tracks](const StereoFrame& f) { tracks->add(f); };
    full.window.add(std::move(builder));
    expect_none(full);
    EXPECT_GT(tracks->counts().started, 1000);
  }
}

}  // namespace
}  // namespace oriel
