// From the last numbers of each edge's line to the information of g2o's error.
#include <algorithm>
#include <utility>

#include "oriel/io/information.h"
#include "oriel/io/pose_graph_lines.h"

namespace oriel::detail {
namespace {

constexpr double kWholeAngles[] = {1, 1, 1, 2, 2, 2};  // φ = 2 · (vector part of the quaternion), near zero

// ff fs ss rr fr sr → 11 12 13 22 23 33.
std::array<double, 6> from_toro_order(const std::array<double, 6>& v) { return {v[0], v[1], v[4], v[2], v[5], v[3]}; }

class Settler {
 public:
  Settler(PoseGraphLines& lines, const PoseGraphReading& reading) : lines_(lines), reading_(reading) {}

  Result<void> settle() {
    PoseGraphFile& g = lines_.graph;
    if (g.spelling == PoseGraphSpelling::toro)
      for (auto& e : g.planar_edges) e.information = from_toro_order(e.information);
    if (!from_isam<3>(g.planar_edges) || !from_isam<6>(g.spatial_edges) || !from_isam<2>(g.planar_sightings) ||
        !from_isam<3>(g.spatial_sightings))
      return error_;
    if (g.spelling != PoseGraphSpelling::g2o)
      for (auto& e : g.spatial_edges) scale_information(e.information.data(), 6, kWholeAngles);
    judge<3>(g.planar_edges, lines_.edges, g.spelling == PoseGraphSpelling::g2o ? "EDGE_SE2" : "EDGE2");
    judge<6>(g.spatial_edges, lines_.edges, g.spelling == PoseGraphSpelling::g2o ? "EDGE_SE3:QUAT" : "EDGE3");
    judge<2>(g.planar_sightings, lines_.sightings, g.spelling == PoseGraphSpelling::g2o ? "EDGE_SE2_XY" : "LANDMARK");
    judge<1>(g.planar_bearings, lines_.bearings, "EDGE_BEARING_SE2_XY");
    judge<3>(g.spatial_sightings, lines_.sightings,
             g.spelling == PoseGraphSpelling::g2o ? "EDGE_SE3_TRACKXYZ" : "POINT3");
    if (!error_.message.empty()) return error_;
    return bad_.empty() ? Result<void>() : refusal();
  }

 private:
  struct Bad {
    std::string name;
    std::int64_t line;
  };

  template <int N, class Edge>
  bool from_isam(std::vector<Edge>& edges) {
    if (lines_.graph.spelling != PoseGraphSpelling::isam || reading_.isam_noise == IsamNoise::information) return true;
    for (Edge& e : edges) {
      if (reading_.isam_noise == IsamNoise::root) {
        square_root_information(e.information.data(), N);
      } else if (!invert_covariance(e.information.data(), N)) {
        error_ = {ErrorCode::indefinite, "expected a positive definite covariance", lines_.graph.file_name, e.line};
        return false;
      }
    }
    return true;
  }

  template <int N, class Edge>
  void judge(std::vector<Edge>& edges, const std::vector<PoseGraphLines::Ends>& ends, const char* tag) {
    for (std::size_t k = 0; k < edges.size(); ++k) {
      auto& information = edges[k].information;
      const bool fits = positive_semidefinite(information.data(), N);
      if (!fits && reading_.project_information) {
        project_to_semidefinite(information.data(), N);
        ++lines_.graph.information_repaired;
        lines_.graph.repaired_lines.push_back(edges[k].line);
      } else if (!fits) {
        const auto& [first, second] = ends[k];
        bad_.push_back({std::string(tag) + " " + std::to_string(first) + " " + std::to_string(second), edges[k].line});
      }
      // The numbers of a line are finite; squares and inverses of them, or sums, need not be.
      if (!finite(information) && error_.message.empty())
        error_ = {ErrorCode::not_finite, std::string(tag) + ": expected information within the range of doubles",
                  lines_.graph.file_name, edges[k].line};
    }
  }

  template <class List>
  static bool finite(const List& list) {
    double sum = 0.0;  // of zeros, unless one is infinite or no number
    for (const double x : list) sum += 0.0 * x;
    return sum == 0.0;
  }

  // The first by name, some of the others by line.
  Error refusal() {
    constexpr std::size_t kShown = 6;
    std::stable_sort(bad_.begin(), bad_.end(), [](const Bad& a, const Bad& b) { return a.line < b.line; });
    std::string text = bad_[0].name;
    if (bad_.size() > 1) {
      text += " and " + std::to_string(bad_.size() - 1) + " more (in line";
      for (std::size_t k = 1; k < std::min(bad_.size(), kShown); ++k)
        text += (k == 1 ? " " : ", ") + std::to_string(bad_[k].line);
      text += bad_.size() > kShown ? ", ...)" : ")";
    }
    return {ErrorCode::indefinite, text + ": expected positive semidefinite information, found a negative eigenvalue",
            lines_.graph.file_name, bad_[0].line};
  }

  PoseGraphLines& lines_;
  const PoseGraphReading& reading_;
  std::vector<Bad> bad_;
  Error error_;
};

}  // namespace

Result<void> settle_information(PoseGraphLines& lines, const PoseGraphReading& reading) {
  return Settler(lines, reading).settle();
}

PoseGraphSpelling guess_spelling(const PoseGraphFile& graph) {
  bool toro = !graph.planar_edges.empty(), isam = true;
  for (const auto& e : graph.planar_edges) {
    const auto& v = e.information;
    toro = toro && v[2] > 0 && v[3] > 0 && positive_semidefinite(from_toro_order(v).data(), 3);
    isam = isam && v[3] > 0 && v[5] > 0;  // a root may have anything beside its diagonal
  }
  return toro && !isam ? PoseGraphSpelling::toro : PoseGraphSpelling::isam;
}

}  // namespace oriel::detail
