// A walk past points with a stereo camera, and odometry that is only fair: what tracks make of it, for tests.
#pragma once
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cstring>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "oriel/base/chi_squared.h"
#include "oriel/residual/reprojection.h"
#include "oriel/residual/structureless_track.h"
#include "oriel/solve/native_engine.h"
#include "oriel/window/odometry_provider.h"
#include "oriel/window/sliding_window.h"
#include "residual/random_values.h"

namespace oriel::track_world {

using testing_values::Random;

struct Walk {
  StereoRigd rig = testing_values::euroc_like_rig();
  std::vector<Time> times;
  std::vector<Pose3d> truth;
  std::vector<std::vector<FeatureObservation>> frames;
  std::vector<Pose3d> steps;  // noisy motion since the frame before
  double step_sigma = 0.01;   // that it is said to have [rad] [m]

  // right_every: every how many tracks the right camera sees; 0: none. Then odometry alone knows the scale, and is
  // good. Where pixels are exact, odometry has little to say, or is exact too.
  Walk(int count, double pixel_sigma, int right_every, unsigned seed = 1) {
    Random random(seed);
    double noise = right_every == 0 ? 1e-3 : 1e-2;
    step_sigma = noise;
    if (pixel_sigma == 0.0 && right_every == 0) noise = 0.0;
    if (pixel_sigma == 0.0 && right_every != 0) step_sigma = 1.0;
    std::vector<Vec3d> points;
    for (int k = 0; k < 60 + 4 * count; ++k)
      points.push_back(
          {{random.uniform(-3.0, 0.25 * count + 3.0), random.uniform(-2.0, 2.0), random.uniform(3.0, 7.0)}});
    for (int k = 0; k < count; ++k) {
      times.push_back({1'000'000'000 + 100'000'000LL * k});
      const double s = 0.25 * k;
      truth.push_back(Pose3d{Rot3d::exp({{0.05 * std::sin(s), 0.04 * std::cos(0.7 * s), 0.1 * std::sin(0.3 * s)}}),
                             {{s, 0.2 * std::sin(s), 0.1 * std::cos(s)}}});
      steps.push_back(k == 0 ? Pose3d{} : (truth[k - 1].inverse() * truth[k]).plus(random.normal<6>(noise)));
      frames.emplace_back();
      for (std::size_t p = 0; p < points.size(); ++p)
        look(points[p], static_cast<std::int64_t>(p), pixel_sigma, right_every, random);
    }
  }
  StereoFrame frame(int k) const { return {times[k], frames[k]}; }

 private:
  bool project(int camera, const Vec3d& p, Vec2d& pixel) const {
    const auto& mount = rig.cameras[camera];
    const Vec3d h = mount.T_body_camera().inverse() * (truth.back().inverse() * p);
    return h[2] > 0.5 && mount.camera.project(h, pixel, nullptr) && pixel[0] > 0 && pixel[0] < 752 && pixel[1] > 0 &&
           pixel[1] < 480 && std::hypot(h[0], h[1]) < 0.9 * h[2];
  }
  void look(const Vec3d& p, std::int64_t id, double sigma, int right_every, Random& random) {
    FeatureObservation f;
    f.track = id;
    if (!project(0, p, f.pixel0)) return;
    f.has_right = right_every > 0 && id % right_every == 0 && project(1, p, f.pixel1);
    f.pixel0 += random.normal<2>(sigma);
    f.pixel1 += random.normal<2>(sigma);
    frames.back().push_back(f);
  }
};

// A window over odometry; a builder is added by the test.
struct WalkWindow {
  SlidingWindow window;
  OdometryProvider<Pose3d>* odometry = nullptr;
  ProviderId poses;
  VariableId<StereoRigd> rig;
  LagPolicy* policy = nullptr;

  explicit WalkWindow(const Walk& walk, LandmarkPolicy landmarks, int states = 6) : window(options(landmarks)) {
    auto provider = std::make_unique<OdometryProvider<Pose3d>>(walk.truth[0], Mat6d::identity() * 1e-8);
    odometry = provider.get();
    odometry->start_measuring(walk.times[0]);
    poses = window.add(std::move(provider));
    auto lag = std::make_unique<LagPolicy>();
    policy = lag.get();
    EXPECT_TRUE(policy->set({1, states, {}}).ok());
    window.set(std::move(lag));
    GraphEdit& edit = window.core().edit();
    rig = edit.add(walk.rig);
    EXPECT_TRUE(window.core().commit().ok());
  }
  static WindowOptions options(LandmarkPolicy landmarks) {
    WindowOptions o;
    o.solve.max_iterations = 12;
    o.solve.function_tolerance = 1e-9;
    o.marginalize.landmarks = landmarks;
    return o;
  }
  void move(const Walk& walk, int k) {
    if (k > 0) {
      EXPECT_TRUE(
          odometry->add(walk.times[k], walk.steps[k], Mat6d::identity() * (walk.step_sigma * walk.step_sigma)).ok());
    }
  }
  // The largest distance of a state in the window from the truth [m or rad].
  double error(const Walk& walk) const {
    double worst = 0.0;
    for (const State& s : window.states().timeline(poses)) {
      const auto k = static_cast<std::size_t>((s.time.ns - walk.times[0].ns) / 100'000'000);
      const Pose3d& x = window.graph().value(OdometryProvider<Pose3d>::pose(s));
      worst = std::max(worst, x.minus(walk.truth[k]).norm());
    }
    return worst;
  }
  // eᵀ P⁻¹ e of the newest state's error, P as the window believes it: χ² with 6 degrees of freedom, unless something
  // was counted twice.
  double nees(const Walk& walk) {
    const State& newest = *window.states().timeline(poses).latest();
    const auto id = OdometryProvider<Pose3d>::pose(newest);
    const auto k = static_cast<std::size_t>((newest.time.ns - walk.times[0].ns) / 100'000'000);
    const Vec6d e = walk.truth[k].minus(window.graph().value(id));
    NativeEngine engine(window.core().followed());
    const auto P = engine.covariance(id);
    EXPECT_TRUE(P.ok()) << P.error();
    if (!P) return HUGE_VAL;
    return Eigen::Map<const Eigen::Matrix<double, 6, 1>>(e.m).dot(
        Eigen::Map<const Eigen::Matrix<double, 6, 6>>(P->m).ldlt().solve(
            Eigen::Map<const Eigen::Matrix<double, 6, 1>>(e.m)));
  }
};

// So unlikely that it means a fault.
inline double most_nees() { return chi_squared_threshold(1.0 - 1e-5, 6); }

// Left pixels that factors of the graph hold, each as often as it is held. An anchor's own bearing is measured by all
// its landmark's factors together, and not counted.
inline std::multiset<std::pair<double, double>> pixels_in(const Graph& graph) {
  std::multiset<std::pair<double, double>> all;
  auto take = [&](const Vec2d& pixel) { all.emplace(pixel[0], pixel[1]); };
  auto rows = [&]<class R>(const FactorTable& t, R, auto&& pixel_of) {
    if (t.ops().residual != R::kName) return;
    for (std::uint32_t row = 0; row < t.extent(); ++row) {
      if (!t.slots().is_live(row)) continue;
      R r;
      std::memcpy(static_cast<void*>(&r), t.measurement(row), sizeof(R));
      pixel_of(r);
    }
  };
  auto all_views = [&](const auto& track) {
    for (const TrackView& v : track.views) take(v.pixel0);
  };
  for (const auto& t : graph.tables()) {
    rows(*t, StereoReprojectiond{}, [&](const auto& r) { take(r.pixel0); });
    rows(*t, MonoReprojectiond{}, [&](const auto& r) { take(r.pixel); });
    rows(*t, StereoPointReprojectiond{}, [&](const auto& r) { take(r.pixel0); });
    rows(*t, MonoPointReprojectiond{}, [&](const auto& r) { take(r.pixel); });
    rows(*t, StructurelessTrack<2>{}, all_views);
    rows(*t, StructurelessTrack<3>{}, all_views);
    rows(*t, StructurelessTrack<4>{}, all_views);
    rows(*t, StructurelessTrack<5>{}, all_views);
    rows(*t, StructurelessTrack<6>{}, all_views);
    rows(*t, StructurelessTrack<7>{}, all_views);
    rows(*t, StructurelessTrack<8>{}, all_views);
  }
  return all;
}

// Follows a window, and fails where a pixel is in two factors, or comes back after it has left.
class PixelWatch {
 public:
  void look(const Graph& graph) {
    const auto now = pixels_in(graph);
    for (const auto& p : now) {
      EXPECT_EQ(now.count(p), 1u);
      EXPECT_FALSE(gone_.contains(p)) << "a sighting counts a second time";
    }
    for (const auto& p : before_)
      if (!now.contains(p)) gone_.insert(p);
    before_ = now;
  }
  std::size_t used() const { return before_.size() + gone_.size(); }

 private:
  std::multiset<std::pair<double, double>> before_;
  std::set<std::pair<double, double>> gone_;
};

}  // namespace oriel::track_world
