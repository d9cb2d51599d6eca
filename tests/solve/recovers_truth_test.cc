// Small problems with exact measurements: from a disturbed start a solve finds the truth again, through every residual
// of similarities, registration, directions and cameras with unknown intrinsics.
#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "oriel/residual/calibrated_reprojection.h"
#include "oriel/residual/direction.h"
#include "oriel/residual/registration.h"
#include "oriel/residual/sim3.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

class Draw {
 public:
  explicit Draw(unsigned seed) : engine_(seed) {}
  template <int N>
  Vec<double, N> operator()(double sigma) {
    Vec<double, N> d;
    for (int i = 0; i < N; ++i) d[i] = sigma * normal_(engine_);
    return d;
  }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

Summary solved(Graph& graph) {
  NativeEngine engine(graph);
  Summary summary = engine.solve();
  EXPECT_TRUE(summary.converged()) << summary;
  EXPECT_EQ(summary.kernel_fallbacks, 0);
  EXPECT_EQ(summary.invalid_factors, 0);
  return summary;
}

TEST(RecoversTruth, OfALoopWhoseScaleDrifted) {
  Draw draw(1);
  Graph graph;
  GraphEdit edit = graph.edit();
  std::vector<Sim3d> truth;
  std::vector<VariableId<Sim3d>> ids;
  for (int i = 0; i < 20; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 20;
    truth.push_back({Rot3d::exp({{0, 0, angle}}), {{10 * std::cos(angle), 10 * std::sin(angle), 0.1 * i}}, 1.0});
    // The start's unit of length shrinks along the way, to a third.
    const Sim3d drift = Sim3d::exp({{0, 0, 0, 0, 0, 0, -0.055 * i}});
    ids.push_back(edit.add(i == 0 ? truth[0] : (truth.back() * drift).plus(draw.operator()<7>(0.05))));
  }
  for (std::size_t i = 0; i < 20; ++i) {
    const std::size_t next = (i + 1) % 20;
    edit.add(Between{truth[i].inverse() * truth[next]}, Sigma(0.1), Huber(1.345), ids[i], ids[next]);
  }
  edit.fix(ids[0]);
  ASSERT_TRUE(graph.apply(edit));
  static_cast<void>(solved(graph));
  for (std::size_t i = 0; i < 20; ++i) EXPECT_LT(graph.value(ids[i]).minus(truth[i]).norm(), 1e-5) << i;
}

TEST(RecoversTruth, OfThePoseBetweenTwoClouds) {
  Draw draw(2);
  const Pose3d T_world_a = Pose3d{}.plus(draw.operator()<6>(1.0)), T_world_b = T_world_a.plus(draw.operator()<6>(0.5));
  const Pose3d T_a_b = T_world_a.inverse() * T_world_b;
  for (const int kind : {0, 1, 2}) {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto a = edit.add(T_world_a), b = edit.add(T_world_b.plus(draw.operator()<6>(0.2)));
    edit.fix(a);
    for (int i = 0; i < 12; ++i) {
      const Vec3d p_b = draw.operator()<3>(3.0), p_a = T_a_b * p_b;
      const auto side = UnitVector3d::from_vector(draw.operator()<3>(1.0));
      // Another point of the same plane or line.
      const Vec3d along = side.basis() * draw.operator()<2>(2.0);
      const Mat3d covariance = Mat3d::identity() * 0.01 + side.v * side.v.transposed();
      if (kind == 0) edit.add(PointToPointd{p_a, p_b}, Covariance(covariance), a, b);
      if (kind == 1) edit.add(PointToPlaned{p_a + along, side, p_b}, Sigma(0.1), a, b);
      if (kind == 2) edit.add(PointToLined{p_a + side.v * 3.0, side, p_b}, Sigma(0.1), a, b);
    }
    ASSERT_TRUE(graph.apply(edit));
    static_cast<void>(solved(graph));
    EXPECT_LT(graph.value(b).minus(T_world_b).norm(), 1e-6) << "kind " << kind;
  }
}

TEST(RecoversTruth, OfAPoseFromTheDirectionsToKnownPlaces) {
  Draw draw(3);
  Graph graph;
  GraphEdit edit = graph.edit();
  const Pose3d truth = Pose3d{}.plus(draw.operator()<6>(1.0));
  const auto pose = edit.add(truth.plus(draw.operator()<6>(0.3)));
  for (int i = 0; i < 8; ++i) {  // on all sides, behind too
    const Point3d place{truth * draw.operator()<3>(5.0)};
    const auto id = edit.add(place);
    edit.fix(id);
    const auto seen = UnitVector3d::from_vector(truth.inverse() * place.p);
    edit.add(DirectionToPointd{seen}, Sigma(0.01), pose, id);
  }
  ASSERT_TRUE(graph.apply(edit));
  static_cast<void>(solved(graph));
  EXPECT_LT(graph.value(pose).minus(truth).norm(), 1e-6);
}

// Images of a cloud of points from around it, with one camera for all or one each, none of them known well.
struct Calibration {
  explicit Calibration(bool shared) {
    Draw draw(4);
    GraphEdit edit = graph.edit();
    std::vector<Pose3d> poses;
    std::vector<VariableId<Pose3d>> pose_ids;
    for (int i = 0; i < 6; ++i) {
      const Rot3d R = Rot3d::exp({{0, 0.4 * i - 1.0, 0}}) * Rot3d::exp(draw.operator()<3>(0.1));
      poses.push_back({R, R * Vec3d{{0, 0, -8.0 - 0.5 * i}}});
      // Two known poses fix the gauge, scale included.
      pose_ids.push_back(edit.add(i < 2 ? poses.back() : poses.back().plus(draw.operator()<6>(0.02))));
      if (i < 2) edit.fix(pose_ids.back());
      if (i > 0 && shared) {
        truth.push_back(truth[0]);
        ids.push_back(ids[0]);
      } else {
        truth.push_back({600.0 + 20.0 * i, 590.0, 320.0, 240.0 + i, -0.2 + 0.01 * i, 0.05});
        ids.push_back(edit.add(PinholeIntrinsicsd{640.0, 640.0, 330.0, 230.0, 0.0, 0.0}));
      }
    }
    for (int k = 0; k < 60; ++k) {
      const Point3d place{draw.operator()<3>(1.5)};
      const auto id = edit.add(Point3d{place.p + draw.operator()<3>(0.05)});
      for (std::size_t i = 0; i < 6; ++i) {
        Vec2d pixel;
        if (CalibratedReprojectiond{}.evaluate(poses[i], place, truth[i], pixel, nullptr, nullptr, nullptr))
          edit.add(CalibratedReprojectiond{pixel}, Sigma(1.0), pose_ids[i], id, ids[i]);
      }
    }
    EXPECT_TRUE(graph.apply(edit));
  }
  Graph graph;
  std::vector<PinholeIntrinsicsd> truth;
  std::vector<VariableId<PinholeIntrinsicsd>> ids;
};

TEST(RecoversTruth, OfIntrinsicsThatAllImagesShareOrThatEachHasAlone) {
  for (const bool shared : {true, false}) {
    Calibration c(shared);
    const Summary summary = solved(c.graph);
    EXPECT_LT(summary.final_cost, 1e-6);
    EXPECT_EQ(summary.kept_dim, 4 * 6 + (shared ? 6 : 36));
    for (std::size_t i = 0; i < 6; ++i) {
      const Vec<double, 6> off = c.graph.value(c.ids[i]).minus(c.truth[i]);
      EXPECT_LT(off.segment<4>(0).norm(), 1e-2) << "image " << i << ": " << off;
      EXPECT_LT(off.segment<2>(4).norm(), 1e-4) << "image " << i << ": " << off;
    }
  }
}

}  // namespace
}  // namespace oriel
