// Whole problems without an anchor: how many directions are common to all, and what is missing beside them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/residual/between.h"
#include "oriel/residual/imu_residual.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/reprojection.h"
#include "oriel/solve/native_engine.h"
#include "oriel/testing/simulated_window.h"

namespace oriel {
namespace {

constexpr Method kMethods[] = {Method::levenberg_marquardt, Method::gauss_newton};

struct Bearing {  // of a point in a camera: x/z, y/z, nothing of scale
  static constexpr std::string_view kName = "test.bearing/1";
  using Variables = Types<Pose3d, Point3d>;
  Vec2d at;
  template <class S>
  Vec<S, 2> operator()(const Pose3<S>& T_world_camera, const Point3<S>& p) const {
    const Vec<S, 3> q = T_world_camera.inverse() * p.p;
    return {{q[0] / q[2] - at[0], q[1] / q[2] - at[1]}};
  }
};

class Random {
 public:
  double operator()(double scale) { return std::uniform_real_distribution<double>(-scale, scale)(random_); }
  Vec6d six(double scale) {
    Vec6d d;
    for (int i = 0; i < 6; ++i) d[i] = (*this)(scale);
    return d;
  }

 private:
  std::mt19937 random_{4};
};

// Cameras that look along z at points in front of them, all from noise-free bearings, started a little off.
struct BundleAdjustment {
  Graph graph;
  GraphEdit edit = graph.edit();
  std::vector<VariableId<Pose3d>> cameras;
  std::vector<VariableId<Point3d>> points;
  std::vector<Pose3d> truth;

  explicit BundleAdjustment(double off = 0.01) {
    Random random;
    for (int i = 0; i < 5; ++i) {
      truth.push_back(Pose3d{}.plus({{0.02 * i, -0.03 * i, 0.01 * i, 0.5 * i, 0.2 * (i % 2), 0.1 * i}}));
      cameras.push_back(edit.add(truth.back().plus(random.six(off)), Label("camera", i)));
    }
    for (int k = 0; k < 30; ++k) {
      const Vec3d p = {{random(2.0) + 1.0, random(2.0), 6.0 + random(2.0)}};
      points.push_back(edit.add(Point3d{{{p[0] + random(off), p[1] + random(off), p[2] + random(off)}}}));
      for (std::size_t i = 0; i < cameras.size(); ++i) see(i, p, points.back());
    }
  }
  void see(std::size_t camera, const Vec3d& p, VariableId<Point3d> point) {
    const Vec3d q = truth[camera].inverse() * p;
    edit.add(Bearing{{{q[0] / q[2], q[1] / q[2]}}}, Sigma(0.001), cameras[camera], point);
  }
};

TEST(Gauge, OfABundleAdjustmentWithoutAFixedCameraHasSevenDirections) {  // L6
  for (const Method method : kMethods) {
    BundleAdjustment b;
    ASSERT_TRUE(b.graph.apply(b.edit));
    NativeEngine engine(b.graph);
    const Summary s = engine.solve({.method = method, .max_iterations = 30});
    EXPECT_EQ(s.gauge.size(), 7u) << s;  // 6 and the scale
    EXPECT_TRUE(s.undetermined.empty());
    for (const auto& d : s.gauge) {
      EXPECT_GE(d.variables, b.cameras.size());
      EXPECT_EQ(d.scalars.at(0).id.type, kVariableOps<Pose3d>.key);
    }
    EXPECT_LT(s.final_cost, 1e-6 * s.initial_cost);
  }
}

TEST(Gauge, OfABundleAdjustmentWithOneCameraFixedIsItsScale) {  // L6
  BundleAdjustment b;
  b.edit.fix(b.cameras[0]);
  ASSERT_TRUE(b.graph.apply(b.edit));
  NativeEngine engine(b.graph);
  const Summary s = engine.solve();
  EXPECT_EQ(s.gauge.size(), 1u) << s;
  EXPECT_TRUE(s.undetermined.empty());
}

// One camera is fixed and one is free: scale moves that one and the landmarks, most of the whole.
TEST(Gauge, IsToldByTheLandmarksWhereOnlyOneCameraIsFree) {  // L6
  Graph graph;
  GraphEdit edit = graph.edit();
  Random random;
  const auto fixed = edit.add(Pose3d{}), free = edit.add(Pose3d{}.plus({{0.0, 0.0, 0.0, 1.0, 0.0, 0.0}}));
  edit.fix(fixed);
  for (int k = 0; k < 12; ++k) {
    const Vec3d p = {{random(2.0), random(2.0), 6.0 + random(2.0)}};
    const auto point = edit.add(Point3d{p});
    edit.add(Bearing{{{p[0] / p[2], p[1] / p[2]}}}, Sigma(0.001), fixed, point);
    edit.add(Bearing{{{(p[0] - 1.0) / p[2], p[1] / p[2]}}}, Sigma(0.001), free, point);
  }
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary s = engine.solve();
  ASSERT_EQ(s.gauge.size(), 1u) << s;
  EXPECT_EQ(s.gauge[0].variables, 13u);
  EXPECT_TRUE(s.undetermined.empty());
}

TEST(Gauge, StandsBesideALandmarkThatIsSeenOnce) {  // L6
  BundleAdjustment b;
  const Vec3d p = {{0.4, 0.3, 5.0}};
  const auto once = b.edit.add(Point3d{p}, Label("once"));
  b.see(2, p, once);
  ASSERT_TRUE(b.graph.apply(b.edit));
  NativeEngine engine(b.graph);
  const Summary s = engine.solve();
  EXPECT_EQ(s.gauge.size(), 7u) << s;
  ASSERT_EQ(s.undetermined.size(), 1u);
  EXPECT_EQ(s.undetermined[0].scalars.at(0).id, VariableKey(once));
  EXPECT_NE(describe(b.graph, s.undetermined[0]).find("'once'"), std::string::npos);
}

template <class Pose, int N>
std::vector<VariableId<Pose>> add_ring(GraphEdit& edit, int n, const Vec<double, N>& step) {
  std::vector<VariableId<Pose>> x;
  Pose at;
  for (int i = 0; i < n; ++i) {
    Vec<double, N> off;
    for (int k = 0; k < N; ++k) off[k] = 0.02 * ((i + k) % 3 - 1);
    x.push_back(edit.add(at.plus(off)));
    at = at.plus(step);
  }
  for (std::size_t i = 0; i + 1 < x.size(); ++i) edit.add(Between{Pose{}.plus(step)}, Sigma(0.1), x[i], x[i + 1]);
  edit.add(Between{Pose{}.plus(step).plus(step)}, Sigma(0.1), x[0], x[2]);
  return x;
}

TEST(Gauge, OfAPoseGraphHasThreeDirectionsInThePlane) {  // L6
  for (const Method method : kMethods) {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto x = add_ring<Pose2d, 3>(edit, 9, {{0.3, 1.0, 0.1}});
    ASSERT_TRUE(graph.apply(edit));
    NativeEngine engine(graph);
    const Summary s = engine.solve({.method = method});
    EXPECT_TRUE(s.converged()) << s;
    EXPECT_EQ(s.gauge.size(), 3u);
    EXPECT_TRUE(s.undetermined.empty());
    for (const auto& d : s.gauge) EXPECT_GE(2 * d.variables, x.size());
  }
}

TEST(Gauge, OfTwoPoseGraphsIsThatOfEach) {  // L6
  for (const Method method : kMethods) {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto a = add_ring<Pose3d, 6>(edit, 5, {{0.1, 0.2, 0.3, 1.0, 0.2, 0.1}});
    const auto b = add_ring<Pose3d, 6>(edit, 12, {{0.2, -0.1, 0.1, 0.5, 0.9, 0.1}});
    ASSERT_TRUE(graph.apply(edit));
    NativeEngine engine(graph);
    const Summary s = engine.solve({.method = method});
    EXPECT_TRUE(s.converged()) << s;
    EXPECT_EQ(s.gauge.size(), 12u) << s;
    EXPECT_TRUE(s.undetermined.empty());
    int of_a = 0;
    for (const auto& d : s.gauge) {
      const bool in_a =
          std::find_if(a.begin(), a.end(), [&](auto id) { return VariableKey(id) == d.scalars.at(0).id; }) != a.end();
      of_a += in_a;
      EXPECT_EQ(d.variables, in_a ? a.size() : b.size());
    }
    EXPECT_EQ(of_a, 6);
  }
}

TEST(Gauge, OfOnePoseGraphStandsBesideOneThatIsHeld) {  // L6
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = add_ring<Pose2d, 3>(edit, 4, {{0.3, 1.0, 0.1}});
  const auto b = add_ring<Pose2d, 3>(edit, 30, {{0.2, 1.0, 0.1}});
  edit.add(Prior{Pose2d{}}, Sigma(0.1), b[3]);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary s = engine.solve();
  EXPECT_EQ(s.gauge.size(), 3u) << s;
  EXPECT_TRUE(s.undetermined.empty());
  for (const auto& d : s.gauge) EXPECT_EQ(d.variables, a.size());
}

// A stereo-inertial window without priors: gravity holds roll and pitch; yaw and position are free.
TEST(Gauge, OfAVisualInertialWindowIsYawAndPosition) {  // L6
  const SimulatedWindow stream = simulate_window({.keyframes = 8, .window = 8, .landmarks = 60});
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto rig = edit.add(stream.rig);
  std::vector<VariableId<Pose3d>> poses;
  std::vector<VariableId<Velocity3d>> velocities;
  std::vector<VariableId<ImuBiasd>> biases;
  std::vector<VariableId<InverseDepthd>> depths(stream.tracks.size());
  for (std::size_t k = 0; k < stream.keyframes.size(); ++k) {
    const SimulatedKeyframe& frame = stream.keyframes[k];
    poses.push_back(edit.add(frame.T_world_body, Label("pose", static_cast<std::int64_t>(k))));
    velocities.push_back(edit.add(frame.v));
    biases.push_back(edit.add(frame.bias));
    if (k > 0)
      edit.add(ImuResiduald{frame.motion.motion}, imu_noise(frame.motion), poses[k - 1], velocities[k - 1],
               biases[k - 1], poses[k], velocities[k], biases[k]);
    for (const SimulatedObservation& o : frame.observations) {
      const SimulatedTrack& track = stream.tracks[o.track];
      if (track.anchor == static_cast<int>(k)) {
        depths[o.track] = edit.add(InverseDepthd{track.first_guess});
        edit.add(AnchorReprojectiond{track.bearing, o.pixel1}, Sigma(1.0), depths[o.track], rig);
      } else {
        edit.add(StereoReprojectiond{track.bearing, o.pixel0, o.pixel1}, Sigma(1.0), poses[track.anchor], poses[k],
                 depths[o.track], rig);
      }
    }
  }
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary s = engine.solve({.max_iterations = 20});
  EXPECT_EQ(s.gauge.size(), 4u) << s;
  EXPECT_TRUE(s.undetermined.empty());
  for (const auto& d : s.gauge) EXPECT_EQ(d.scalars.at(0).id.type, kVariableOps<Pose3d>.key);
}

}  // namespace
}  // namespace oriel
