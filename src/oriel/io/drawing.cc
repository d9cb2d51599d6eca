#include "oriel/io/drawing.h"

#include "oriel/io/text.h"
#include "oriel/manifold/so3.h"

namespace oriel {
namespace {

template <class Edges>
void add_lines(const Edges& edges, Drawing& drawing) {
  for (const auto& e : edges) {
    const bool consecutive = e.from - e.to == 1 || e.to - e.from == 1;
    (consecutive ? drawing.path : drawing.loops).push_back({e.from, e.to});
  }
}

}  // namespace

Drawing drawing_of(const PoseGraphFile& file) {
  Drawing d;
  for (const Vec3d& p : file.planar_poses) d.poses.push_back({p[0], p[1], 0});
  for (const auto& p : file.spatial_poses) d.poses.push_back(p.t);
  for (const Vec2d& p : file.planar_landmarks) d.landmarks.push_back({p[0], p[1], 0});
  d.landmarks.insert(d.landmarks.end(), file.spatial_landmarks.begin(), file.spatial_landmarks.end());
  add_lines(file.planar_edges, d);
  add_lines(file.spatial_edges, d);
  return d;
}

Drawing drawing_of(const BalFile& file) {
  Drawing d;
  for (const auto& c : file.cameras) {
    const Rot3d R = Rot3d::exp({{c[0], c[1], c[2]}});
    d.poses.push_back(-(R.inverse() * Vec3d{c[3], c[4], c[5]}));
  }
  d.landmarks = file.points;
  return d;
}

std::string format_ply(const Drawing& d) {
  std::string out = "ply\nformat ascii 1.0\ncomment landmarks, then poses or centres of cameras [m]\nelement vertex ";
  append_number(out, static_cast<std::int64_t>(d.landmarks.size() + d.poses.size()));
  out += "\nproperty double x\nproperty double y\nproperty double z\n";
  out += "property uchar red\nproperty uchar green\nproperty uchar blue\nelement edge ";
  append_number(out, static_cast<std::int64_t>(d.path.size() + d.loops.size()));
  out += "\nproperty int vertex1\nproperty int vertex2\nend_header\n";
  const auto place = [&](const Vec3d& p, const char* colour) {
    for (int i = 0; i < 3; ++i) append_number(out, p[i]), out += ' ';
    out += colour;
  };
  for (const Vec3d& p : d.landmarks) place(p, "200 120 20\n");
  for (const Vec3d& p : d.poses) place(p, "30 80 200\n");
  const auto first_pose = static_cast<std::int64_t>(d.landmarks.size());
  for (const auto* lines : {&d.path, &d.loops})
    for (const auto& [a, b] : *lines) {
      append_number(out, first_pose + a);
      out += ' ';
      append_number(out, first_pose + b);
      out += '\n';
    }
  return out;
}

}  // namespace oriel
