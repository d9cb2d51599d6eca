// Rays to points, points to poses, and the books of tracks.
#include <gtest/gtest.h>

#include <cstring>

#include "oriel/window/refine_pose.h"
#include "oriel/window/track_map.h"
#include "oriel/window/triangulate.h"
#include "simulated_flight.h"

namespace oriel {
namespace {

TEST(Triangulate, FindsThePointWhereRaysMeet) {
  const Vec3d p = {{1.0, -2.0, 6.0}}, origins[] = {{{0.0, 0.0, 0.0}}, {{1.0, 0.0, 0.0}}, {{0.0, 1.0, 0.5}}};
  std::vector<Ray> rays;
  for (const Vec3d& o : origins) rays.push_back({o, (p - o) * 3.7});
  const std::optional<Vec3d> found = triangulate(rays, 0.01);
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((*found - p).norm(), 1e-12);
}

TEST(Triangulate, FindsNothingWhereRaysAreParallel) {
  const Ray rays[] = {{{{0.0, 0.0, 0.0}}, {{0.0, 0.0, 1.0}}}, {{{0.1, 0.0, 0.0}}, {{0.0, 0.0, 2.0}}}};
  EXPECT_FALSE(triangulate(rays, 0.0).has_value());
  EXPECT_FALSE(triangulate(std::span(rays, 1), 0.0).has_value());
}

TEST(Triangulate, AsksForTheParallaxThatItIsTold) {
  const Vec3d p = {{0.0, 0.0, 10.0}}, o = {{0.1, 0.0, 0.0}};
  const Ray rays[] = {{Vec3d::zero(), p}, {o, p - o}};  // 0.01 rad apart
  EXPECT_TRUE(triangulate(rays, 0.009).has_value());
  EXPECT_FALSE(triangulate(rays, 0.011).has_value());
}

// Points of a room as one frame of a flight sees them, without noise but for gross errors.
struct View {
  SimulatedFlight flight{FlightOptions{.duration_s = 0.0, .pixel_sigma = 0.0, .gross_errors = 0.0}};
  std::vector<PointSighting> sightings;
  std::vector<double> scratch;
  Pose3d truth = flight.pose(0.0);
  View() {
    for (const FeatureObservation& f : flight.frames[0].features) {
      if (!f.has_right) continue;
      Ray rays[2];
      for (int c = 0; c < 2; ++c) {
        const auto& m = flight.rig.cameras[c];
        const Vec2d b = *m.camera.unproject(c == 0 ? f.pixel0 : f.pixel1);
        rays[c] = {truth * m.t_body_camera, truth.R * (m.R_body_camera * Vec3d{{b[0], b[1], 1.0}})};
      }
      if (const auto p = triangulate(rays, 0.001)) sightings.push_back({*p, f.pixel0, f.pixel1, true});
    }
  }
};

TEST(RefinePose, FindsThePoseFromAStartThatIsHundredsOfPixelsOff) {
  View v;
  Pose3d T = v.truth.plus({{0.1, -0.2, 0.15, 0.5, -0.3, 0.4}});
  const RefinePoseReport report = refine_pose(v.sightings, v.flight.rig, {}, T, v.scratch);
  EXPECT_TRUE(report.solved);
  EXPECT_GT(report.median_before, 100.0);
  EXPECT_LT(T.minus(v.truth).norm(), 1e-6);
}

TEST(RefinePose, IsNotMovedByAFifthOfGrossErrors) {
  View v;
  for (std::size_t k = 0; k < v.sightings.size(); k += 5)
    v.sightings[k].pixel0 = {{20.0 + static_cast<double>(k), 400.0}};
  Pose3d T = v.truth.plus({{0.05, -0.05, 0.05, 0.2, -0.1, 0.1}});
  const RefinePoseReport report = refine_pose(v.sightings, v.flight.rig, {}, T, v.scratch);
  EXPECT_LT(T.minus(v.truth).norm(), 2e-3);
  EXPECT_LE(report.inliers, static_cast<int>(v.sightings.size() * 4 / 5 + 1));
}

TEST(RefinePose, LeavesThePoseAloneWhereTooFewPointsDetermineIt) {
  View v;
  v.sightings.resize(2);
  for (PointSighting& s : v.sightings) s.has_right = false;
  const Pose3d start = v.truth.plus({{0.01, 0.0, 0.0, 0.0, 0.0, 0.0}});
  Pose3d T = start;
  EXPECT_FALSE(refine_pose(v.sightings, v.flight.rig, {}, T, v.scratch).solved);
  EXPECT_EQ(std::memcmp(&T, &start, sizeof T), 0);
}

struct Tracks {
  StereoRigd rig;
  TrackMap map{rig_with(rig), true};
  std::vector<std::uint32_t> seen;
  static StereoRigd rig_with(StereoRigd r) {
    for (auto& m : r.cameras) m.camera = RadTanCamerad{400.0, 400.0, 300.0, 200.0, 0.0, 0.0, 0.0, 0.0};
    return r;
  }
  void see(std::int64_t ns, std::initializer_list<std::int64_t> ids) {
    std::vector<FeatureObservation> features;
    for (const std::int64_t id : ids) features.push_back({id, {{300.0, 200.0}}, {{290.0, 200.0}}, true});
    map.observe({{ns}, features}, {}, seen);
  }
};

TEST(TrackMap, CollectsTheSightingsOfATrackInTheOrderOfTime) {
  Tracks t;
  t.see(1, {7, 3});
  t.see(2, {3, 9});
  const Track& track = t.map.track(t.map.find(3));
  ASSERT_EQ(track.sightings.size(), 2u);
  EXPECT_EQ(track.sightings[0].time.ns, 1);
  EXPECT_EQ(track.sightings[1].time.ns, 2);
  EXPECT_EQ(t.map.track(t.seen[1]).id, 9);
}

TEST(TrackMap, ForgetsTheSightingsOfAStateAndTheTracksThatItAloneSaw) {
  Tracks t;
  t.see(1, {7, 3});
  t.see(2, {3, 9});
  t.map.forget({1});
  EXPECT_EQ(t.map.find(7), t.map.extent());
  EXPECT_EQ(t.map.track(t.map.find(3)).sightings.size(), 1u);
}

TEST(TrackMap, BeginsAClosedTrackAnewWithoutItsOldSightings) {
  Tracks t;
  t.see(1, {3});
  t.map.close(t.map.find(3));
  t.see(2, {3});
  const Track& track = t.map.track(t.map.find(3));
  ASSERT_EQ(track.sightings.size(), 1u);
  EXPECT_EQ(track.sightings[0].time.ns, 2);
}

TEST(TrackMap, UsesThePlacesOfGoneTracksAgain) {
  Tracks t;
  for (std::int64_t k = 0; k < 1000; ++k) {
    t.see(k, {k, k + 1, k + 2});
    t.map.forget({k - 1});
  }
  EXPECT_LE(t.map.extent(), 6u);
}

}  // namespace
}  // namespace oriel
