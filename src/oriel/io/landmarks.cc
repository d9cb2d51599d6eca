#include "oriel/io/landmarks.h"

#include <cmath>

#include "oriel/io/information.h"
#include "oriel/residual/landmark2.h"
#include "oriel/residual/landmark3.h"

namespace oriel {
namespace {

SensorPosed sensor_of(const PoseGraphFile::SensorOffset& o) {
  const auto& p = o.T_body_sensor;
  return {Pose3d{Rot3d{p.qx, p.qy, p.qz, p.qw}, p.t}};
}

double sigma_of(const PoseGraphFile::PlanarBearing& b) { return 1.0 / std::sqrt(b.information[0]); }

// Lines through t along d (unit): Σ (I - d dᵀ)(l - t) = 0.
struct Crossing {
  Mat<double, 2, 2> A = Mat<double, 2, 2>::zero();
  Vec2d b = Vec2d::zero(), first{}, along{};
  int lines = 0;

  void add(const Vec2d& t, const Vec2d& d) {
    if (lines++ == 0) first = t, along = d;
    const Mat<double, 2, 2> P = {{1 - d[0] * d[0], -d[0] * d[1], -d[0] * d[1], 1 - d[1] * d[1]}};
    A = A + P;
    b = b + P * t;
  }
  // Nearly parallel lines meet nowhere that is worth a start.
  Vec2d point() const {
    const double det = A(0, 0) * A(1, 1) - A(0, 1) * A(1, 0);
    if (det > 1e-4 * lines * lines) {
      const Vec2d p = {{(A(1, 1) * b[0] - A(0, 1) * b[1]) / det, (A(0, 0) * b[1] - A(1, 0) * b[0]) / det}};
      if ((p - first).dot(along) > 0) return p;
    }
    return first + along;
  }
};

template <class Point, class Sighting, class Place>
std::vector<char> place_first(const std::vector<Sighting>& sightings, std::vector<Point>& landmarks, Place&& place) {
  std::vector<char> known(landmarks.size(), 0);
  for (const Sighting& s : sightings) {
    const auto l = static_cast<std::size_t>(s.landmark);
    if (known[l]) continue;
    known[l] = 1;
    landmarks[l].p = place(s);
  }
  return known;
}

// ½ρ(rᵀ Ω r).
template <int N, class Residual, class... Value>
double cost_of(const Residual& residual, const double* information, const Loss& loss, const Value&... values) {
  Vec<double, N> r;
  if (!residual.evaluate(values..., r, nullptr, nullptr)) return 0.0;
  return 0.5 * evaluate_loss(loss, squared_norm(r, from_upper<N>(information))).rho;
}

template <class Point>
std::vector<VariableId<Point>> add_points(GraphEdit& edit, const PoseGraphFile& file, const std::vector<Point>& start) {
  std::vector<VariableId<Point>> ids;
  ids.reserve(start.size());
  for (const Point& p : start) ids.push_back(edit.add(p));
  for (const std::int32_t i : file.fixed_landmarks) edit.fix(ids[static_cast<std::size_t>(i)]);
  return ids;
}

}  // namespace

std::vector<Point2d> place_landmarks2(const PoseGraphFile& file, const std::vector<Pose2d>& poses) {
  std::vector<Point2d> landmarks(file.landmark_ids.size());
  const std::vector<char> known =
      place_first(file.planar_sightings, landmarks, [&](const auto& s) { return poses[s.pose] * s.measurement; });
  std::vector<Crossing> crossings(file.planar_bearings.empty() ? 0 : landmarks.size());
  for (const auto& b : file.planar_bearings) {
    const Pose2d& x = poses[b.pose];
    const Rot2d d = x.R * Rot2d::exp(b.measurement);
    crossings[b.landmark].add(x.t, {{d.c, d.s}});
  }
  for (std::size_t l = 0; l < crossings.size(); ++l)
    if (!known[l] && crossings[l].lines > 0) landmarks[l].p = crossings[l].point();
  return landmarks;
}

std::vector<Point3d> place_landmarks3(const PoseGraphFile& file, const std::vector<Pose3d>& poses) {
  std::vector<Point3d> landmarks(file.landmark_ids.size());
  place_first(file.spatial_sightings, landmarks, [&](const auto& s) {
    return poses[s.pose] * (sensor_of(file.offsets[s.offset]).T_body_sensor * s.measurement);
  });
  return landmarks;
}

std::vector<Point2d> start_landmarks2(const PoseGraphFile& file, bool from_file, const std::vector<Pose2d>& poses) {
  std::vector<Point2d> landmarks = place_landmarks2(file, poses);
  for (std::size_t l = 0; from_file && l < file.planar_landmarks.size(); ++l) landmarks[l].p = file.planar_landmarks[l];
  for (std::size_t k = 0; !from_file && !file.planar_landmarks.empty() && k < file.fixed_landmarks.size(); ++k)
    landmarks[file.fixed_landmarks[k]].p = file.planar_landmarks[file.fixed_landmarks[k]];
  return landmarks;
}

std::vector<Point3d> start_landmarks3(const PoseGraphFile& file, bool from_file, const std::vector<Pose3d>& poses) {
  std::vector<Point3d> landmarks = place_landmarks3(file, poses);
  for (std::size_t l = 0; from_file && l < file.spatial_landmarks.size(); ++l)
    landmarks[l].p = file.spatial_landmarks[l];
  for (std::size_t k = 0; !from_file && !file.spatial_landmarks.empty() && k < file.fixed_landmarks.size(); ++k)
    landmarks[file.fixed_landmarks[k]].p = file.spatial_landmarks[file.fixed_landmarks[k]];
  return landmarks;
}

double landmark_cost2(const PoseGraphFile& file, const std::vector<Pose2d>& poses,
                      const std::vector<Point2d>& landmarks, const Loss& loss) {
  double sum = 0.0;
  for (const auto& s : file.planar_sightings)
    sum += cost_of<2>(Sighting2d{s.measurement}, s.information.data(), loss, poses[s.pose], landmarks[s.landmark]);
  for (const auto& b : file.planar_bearings)
    sum += cost_of<1>(Bearing2d{b.measurement}, b.information.data(), loss, poses[b.pose], landmarks[b.landmark]);
  return sum;
}

double landmark_cost3(const PoseGraphFile& file, const std::vector<Pose3d>& poses,
                      const std::vector<Point3d>& landmarks, const Loss& loss) {
  double sum = 0.0;
  for (const auto& s : file.spatial_sightings)
    sum += cost_of<3>(Sighting3d{s.measurement}, s.information.data(), loss, poses[s.pose], landmarks[s.landmark],
                      sensor_of(file.offsets[s.offset]));
  return sum;
}

std::vector<VariableId<Point2d>> add_landmarks2(GraphEdit& edit, const PoseGraphFile& file,
                                                const std::vector<VariableId<Pose2d>>& poses,
                                                const std::vector<Point2d>& start, const Loss& loss) {
  auto ids = add_points(edit, file, start);
  for (const auto& s : file.planar_sightings)
    edit.add(Sighting2d{s.measurement}, Information(from_upper<2>(s.information.data())), loss, poses[s.pose],
             ids[s.landmark]);
  for (const auto& b : file.planar_bearings)
    if (b.information[0] > 0)  // none says nothing
      edit.add(Bearing2d{b.measurement}, Sigma(sigma_of(b)), loss, poses[b.pose], ids[b.landmark]);
  return ids;
}

std::vector<VariableId<Point3d>> add_landmarks3(GraphEdit& edit, const PoseGraphFile& file,
                                                const std::vector<VariableId<Pose3d>>& poses,
                                                const std::vector<Point3d>& start, const Loss& loss) {
  auto ids = add_points(edit, file, start);
  std::vector<VariableId<SensorPosed>> sensors;
  for (const auto& o : file.offsets) sensors.push_back(edit.add(sensor_of(o)));
  for (const auto& s : file.spatial_sightings)
    edit.add(Sighting3d{s.measurement}, Information(from_upper<3>(s.information.data())), loss, poses[s.pose],
             ids[s.landmark], sensors[s.offset]);
  return ids;
}

}  // namespace oriel
