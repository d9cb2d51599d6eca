#include "oriel/io/g2o.h"

#include <algorithm>
#include <utility>

#include "oriel/io/information.h"
#include "oriel/io/pose_graph_lines.h"
#include "oriel/io/problem_text.h"
#include "oriel/io/text.h"

namespace oriel {
namespace {

using SpatialPose = PoseGraphFile::SpatialPose;

class Writer {
 public:
  explicit Writer(const PoseGraphFile& graph) : g_(graph), shift_(landmark_shift(graph)) {}

  std::string text() {
    for (const auto& o : g_.offsets) line("PARAMS_SE3OFFSET", o.id), values(o.T_body_sensor), end();
    vertices("VERTEX_SE2", g_.ids, 0, g_.planar_poses);
    vertices("VERTEX_SE3:QUAT", g_.ids, 0, g_.spatial_poses);
    vertices("VERTEX_XY", g_.landmark_ids, shift_, g_.planar_landmarks);
    vertices("VERTEX_TRACKXYZ", g_.landmark_ids, shift_, g_.spatial_landmarks);
    for (const std::int32_t i : g_.fixed) line("FIX", pose(i)), end();
    for (const std::int32_t i : g_.fixed_landmarks) line("FIX", landmark(i)), end();
    for (const auto& e : g_.planar_edges) edge("EDGE_SE2", pose(e.from), pose(e.to), e);
    for (const auto& e : g_.spatial_edges) edge("EDGE_SE3:QUAT", pose(e.from), pose(e.to), e);
    for (const auto& s : g_.planar_sightings) edge("EDGE_SE2_XY", pose(s.pose), landmark(s.landmark), s);
    for (const auto& s : g_.planar_bearings) edge("EDGE_BEARING_SE2_XY", pose(s.pose), landmark(s.landmark), s);
    for (const auto& s : g_.spatial_sightings) edge("EDGE_SE3_TRACKXYZ", pose(s.pose), landmark(s.landmark), s);
    return std::move(out_);
  }

 private:
  // g2o's landmarks share the ids of poses; those of iSAM may not.
  static std::int64_t landmark_shift(const PoseGraphFile& g) {
    const auto& ids = g.landmark_ids;
    const bool clash = std::any_of(ids.begin(), ids.end(),
                                   [&](std::int64_t id) { return std::binary_search(g.ids.begin(), g.ids.end(), id); });
    return clash ? g.ids.back() + 1 : 0;
  }

  std::int64_t pose(std::int32_t i) const { return g_.ids[static_cast<std::size_t>(i)]; }
  std::int64_t landmark(std::int32_t i) const { return g_.landmark_ids[static_cast<std::size_t>(i)] + shift_; }

  void line(std::string_view tag, std::int64_t id) {
    out_ += tag;
    integer(id);
  }
  void end() { out_ += '\n'; }
  void integer(std::int64_t value) { out_ += ' ', append_number(out_, value); }

  void values(double value) { out_ += ' ', append_number(out_, value); }
  template <int N>
  void values(const Vec<double, N>& v) {
    for (int i = 0; i < N; ++i) values(v[i]);
  }
  void values(const SpatialPose& p) {
    values(p.t);
    for (double q : {p.qx, p.qy, p.qz, p.qw}) values(q);
  }

  template <class Value>
  void vertices(std::string_view tag, const std::vector<std::int64_t>& ids, std::int64_t shift,
                const std::vector<Value>& list) {
    for (std::size_t i = 0; i < list.size(); ++i) line(tag, ids[i] + shift), values(list[i]), end();
  }

  template <class Edge>
  void edge(std::string_view tag, std::int64_t from, std::int64_t to, const Edge& e) {
    line(tag, from), integer(to);
    if constexpr (requires { e.offset; }) integer(g_.offsets[static_cast<std::size_t>(e.offset)].id);
    values(e.measurement);
    for (double value : e.information) values(value);
    end();
  }

  const PoseGraphFile& g_;
  std::int64_t shift_;
  std::string out_;
};

}  // namespace

Mat3d information_matrix(const PoseGraphFile::PlanarEdge& edge) { return from_upper<3>(edge.information.data()); }
Mat6d information_matrix(const PoseGraphFile::SpatialEdge& edge) { return from_upper<6>(edge.information.data()); }

Result<PoseGraphFile> parse_g2o(std::string_view text, std::string file_name, const PoseGraphReading& reading) {
  Result<detail::PoseGraphLines> lines = detail::read_pose_graph_lines(text, std::move(file_name));
  if (!lines) return lines.error();
  if (auto ok = detail::settle_information(*lines, reading); !ok) return ok.error();
  return detail::resolve_pose_graph(std::move(*lines));
}

Result<PoseGraphFile> read_g2o(const std::string& path, const PoseGraphReading& reading) {
  const Result<ProblemText> text = read_problem_text(path);
  if (!text) return text.error();
  return parse_g2o(text->view(), path, reading);
}

std::string format_g2o(const PoseGraphFile& graph) { return Writer(graph).text(); }

Result<void> write_g2o(const std::string& path, const PoseGraphFile& graph) {
  return write_text_file(path, format_g2o(graph));
}

}  // namespace oriel
