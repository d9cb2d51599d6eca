#include "oriel/io/g2o.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "oriel/io/text.h"

namespace oriel {
namespace {

using SpatialPose = PoseGraphFile::SpatialPose;

constexpr std::string_view kVertex2 = "VERTEX_SE2", kVertex3 = "VERTEX_SE3:QUAT";
constexpr std::string_view kEdge2 = "EDGE_SE2", kEdge3 = "EDGE_SE3:QUAT", kFix = "FIX";

constexpr const char* kPlanarFields[] = {"x", "y", "theta", "I11", "I12", "I13", "I22", "I23", "I33"};
constexpr const char* kSpatialFields[] = {"x",   "y",   "z",   "qx",  "qy",  "qz",  "qw",  "I11", "I12", "I13",
                                          "I14", "I15", "I16", "I22", "I23", "I24", "I25", "I26", "I33", "I34",
                                          "I35", "I36", "I44", "I45", "I46", "I55", "I56", "I66"};

template <int N>
Mat<double, N, N> from_upper(const double* upper) {
  Mat<double, N, N> a;
  for (int i = 0; i < N; ++i)
    for (int j = i; j < N; ++j) a(i, j) = a(j, i) = *upper++;
  return a;
}

template <int N>
bool bring_to_unit_diagonal(Mat<double, N, N>& a) {
  double s[N];
  for (int i = 0; i < N; ++i) {
    if (a(i, i) < 0) return false;
    s[i] = a(i, i) > 0 ? 1 / std::sqrt(a(i, i)) : 0;
  }
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) {
      if (a(i, j) != 0 && (s[i] == 0 || s[j] == 0)) return false;
      a(i, j) *= s[i] * s[j];
    }
  return true;
}

// LDLᵀ with the largest remaining diagonal entry as pivot (Golub & Van Loan, Matrix Computations, 4.2.8), on the matrix
// scaled to a unit diagonal, so that metres and radians count alike. What remains when the pivots are used up must be
// zero to rounding.
template <int N>
bool positive_semidefinite(const double* upper) {
  constexpr double kRounding = 1e-9;
  Mat<double, N, N> a = from_upper<N>(upper);
  if (!bring_to_unit_diagonal(a)) return false;
  bool used[N] = {};
  for (int k = 0; k < N; ++k) {
    int p = -1;
    for (int i = 0; i < N; ++i)
      if (!used[i] && (p < 0 || a(i, i) > a(p, p))) p = i;
    if (!(a(p, p) > kRounding)) break;
    used[p] = true;
    const double inverse = 1 / a(p, p);
    for (int j = 0; j < N; ++j) {
      if (used[j]) continue;
      for (int i = 0; i < N; ++i)
        if (!used[i]) a(i, j) -= a(i, p) * inverse * a(p, j);
    }
  }
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j)
      if (!used[i] && !used[j] && !(std::abs(a(i, j)) <= kRounding)) return false;
  return true;
}

bool normalise(double* q) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(norm > 1e-9) || !std::isfinite(norm)) return false;
  for (int i = 0; i < 4; ++i) q[i] /= norm;
  return true;
}

// From the ids of a file to dense indices: a table where the ids are dense, else binary search.
class IdIndex {
 public:
  explicit IdIndex(const std::vector<std::int64_t>& ids) : ids_(ids) {
    if (ids.empty() || ids.back() >= 8 * static_cast<std::int64_t>(ids.size()) + 1024) return;
    table_.assign(static_cast<std::size_t>(ids.back()) + 1, -1);
    for (std::size_t i = 0; i < ids.size(); ++i) table_[static_cast<std::size_t>(ids[i])] = static_cast<int>(i);
  }
  // -1 where the id is unknown.
  std::int32_t find(std::int64_t id) const {
    if (!table_.empty())
      return id < static_cast<std::int64_t>(table_.size()) ? table_[static_cast<std::size_t>(id)] : -1;
    const auto it = std::lower_bound(ids_.begin(), ids_.end(), id);
    return it != ids_.end() && *it == id ? static_cast<std::int32_t>(it - ids_.begin()) : -1;
  }

 private:
  const std::vector<std::int64_t>& ids_;
  std::vector<std::int32_t> table_;
};

class Parser {
 public:
  Parser(std::string_view text, std::string file_name) : scanner_(text) { graph_.file_name = std::move(file_name); }

  Result<PoseGraphFile> parse() {
    while (scanner_.next_line())
      if (!read_line()) return error_;
    if (!resolve()) return error_;
    return std::move(graph_);
  }

 private:
  struct FixLine {
    std::int64_t id, line;
  };

  bool read_line() {
    const std::string_view tag = scanner_.token();
    bool ok;
    if (tag == kEdge2)
      ok = edge<3, 3>(false, tag, kPlanarFields);
    else if (tag == kEdge3)
      ok = edge<7, 6>(true, tag, kSpatialFields);
    else if (tag == kVertex2)
      ok = vertex<3>(false, tag, kPlanarFields);
    else if (tag == kVertex3)
      ok = vertex<7>(true, tag, kSpatialFields);
    else if (tag == kFix)
      ok = fix();
    else
      return fail(ErrorCode::bad_input,
                  "expected VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT or FIX, found " + quote_token(tag));
    return ok && end_of_line(tag);
  }

  template <int Values>
  bool vertex(bool is_3d, std::string_view tag, const char* const* fields) {
    std::int64_t id;
    double v[Values];
    if (!claim_dimension(is_3d, tag) || !read_id(tag, "id", id) || !read_numbers(tag, fields, v, Values)) return false;
    graph_.ids.push_back(id);
    graph_.pose_lines.push_back(scanner_.line());
    if constexpr (Values == 3) {
      graph_.planar_poses.push_back({v[0], v[1], v[2]});
    } else {
      if (!normalise(v + 3)) return bad_quaternion(tag);
      graph_.spatial_poses.push_back({{v[0], v[1], v[2]}, v[3], v[4], v[5], v[6]});
    }
    return true;
  }

  template <int Values, int Dim>
  bool edge(bool is_3d, std::string_view tag, const char* const* fields) {
    constexpr int kInformation = Dim * (Dim + 1) / 2;
    std::int64_t from, to;
    double v[Values + kInformation];
    if (!claim_dimension(is_3d, tag) || !read_id(tag, "from", from) || !read_id(tag, "to", to)) return false;
    if (!read_numbers(tag, fields, v, Values + kInformation)) return false;
    if (!positive_semidefinite<Dim>(v + Values))
      return fail(ErrorCode::indefinite,
                  std::string(tag) + " " + std::to_string(from) + " " + std::to_string(to) +
                      ": expected positive semidefinite information, found a negative eigenvalue");
    if constexpr (Values == 3) {
      auto& e = graph_.planar_edges.emplace_back();
      e.measurement = {v[0], v[1], v[2]};
      finish_edge(e, v + Values, from, to);
    } else {
      if (!normalise(v + 3)) return bad_quaternion(tag);
      auto& e = graph_.spatial_edges.emplace_back();
      e.measurement = {{v[0], v[1], v[2]}, v[3], v[4], v[5], v[6]};
      finish_edge(e, v + Values, from, to);
    }
    return true;
  }

  template <class Edge>
  void finish_edge(Edge& e, const double* information, std::int64_t from, std::int64_t to) {
    std::copy_n(information, e.information.size(), e.information.begin());
    e.line = scanner_.line();
    ends_.emplace_back(from, to);
  }

  bool fix() {
    std::int64_t id;
    if (!read_id(kFix, "id", id)) return false;
    fixes_.push_back({id, scanner_.line()});
    while (!scanner_.at_end_of_line()) {
      if (!read_id(kFix, "id", id)) return false;
      fixes_.push_back({id, scanner_.line()});
    }
    return true;
  }

  bool claim_dimension(bool is_3d, std::string_view tag) {
    if (dimension_known_ && graph_.is_3d != is_3d)
      return fail(ErrorCode::bad_input, std::string("expected ") + (graph_.is_3d ? "SE3:QUAT" : "SE2") +
                                            " as in the lines before, found " + std::string(tag));
    dimension_known_ = true;
    graph_.is_3d = is_3d;
    return true;
  }

  bool read_id(std::string_view tag, const char* field, std::int64_t& id) {
    const NumberFault fault = scanner_.integer(id);
    if (fault == NumberFault::none && id >= 0) return true;
    if (fault == NumberFault::none)
      return fail(ErrorCode::bad_input,
                  std::string(tag) + ": expected an id of 0 or more for " + field + ", found " + std::to_string(id));
    return fail(ErrorCode::bad_input,
                std::string(tag) + ": " + describe_number(fault, "an id", field, scanner_.token()));
  }

  bool read_numbers(std::string_view tag, const char* const* fields, double* out, int count) {
    for (int i = 0; i < count; ++i)
      if (const NumberFault fault = scanner_.number(out[i]); fault != NumberFault::none) {
        const ErrorCode code = fault == NumberFault::not_finite ? ErrorCode::not_finite : ErrorCode::bad_input;
        return fail(code,
                    std::string(tag) + ": " + describe_number(fault, "a finite number", fields[i], scanner_.token()));
      }
    return true;
  }

  bool end_of_line(std::string_view tag) {
    if (scanner_.at_end_of_line()) return true;
    return fail(ErrorCode::bad_input,
                std::string(tag) + ": expected the end of the line, found " + quote_token(scanner_.token()));
  }

  bool bad_quaternion(std::string_view tag) {
    return fail(ErrorCode::bad_input, std::string(tag) + ": expected a quaternion that is not zero");
  }

  bool fail(ErrorCode code, std::string message, std::int64_t line = -1) {
    error_ = {code, std::move(message), graph_.file_name, line < 0 ? scanner_.line() : line};
    return false;
  }

  // Ids to dense indices, in ascending order of id.
  bool resolve() {
    graph_.has_vertices = !graph_.ids.empty();
    if (!(graph_.has_vertices ? sort_poses() : take_poses_from_edges())) return false;
    if (graph_.ids.size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
      return fail(ErrorCode::bad_input, "expected at most 2147483647 poses", 0);
    const IdIndex index(graph_.ids);
    if (!resolve_edges(index, graph_.planar_edges) || !resolve_edges(index, graph_.spatial_edges)) return false;
    for (const FixLine& f : fixes_) {
      const std::int32_t i = index.find(f.id);
      if (i < 0) return fail(ErrorCode::bad_input, "FIX: no pose has the id " + std::to_string(f.id), f.line);
      graph_.fixed.push_back(i);
    }
    std::sort(graph_.fixed.begin(), graph_.fixed.end());
    graph_.fixed.erase(std::unique(graph_.fixed.begin(), graph_.fixed.end()), graph_.fixed.end());
    return true;
  }

  bool sort_poses() {
    auto& ids = graph_.ids;
    if (!std::is_sorted(ids.begin(), ids.end())) {
      std::vector<std::size_t> order(ids.size());
      std::iota(order.begin(), order.end(), 0);
      std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return ids[a] < ids[b]; });
      permute(order, ids);
      permute(order, graph_.pose_lines);
      permute(order, graph_.planar_poses);
      permute(order, graph_.spatial_poses);
    }
    const auto twice = std::adjacent_find(ids.begin(), ids.end());
    if (twice == ids.end()) return true;
    const auto i = static_cast<std::size_t>(twice - ids.begin());
    return fail(ErrorCode::duplicate,
                "expected each pose once, found the id " + std::to_string(*twice) + " again (first in line " +
                    std::to_string(graph_.pose_lines[i]) + ")",
                graph_.pose_lines[i + 1]);
  }

  template <class T>
  static void permute(const std::vector<std::size_t>& order, std::vector<T>& values) {
    if (values.empty()) return;
    std::vector<T> sorted;
    sorted.reserve(values.size());
    for (std::size_t i : order) sorted.push_back(values[i]);
    values.swap(sorted);
  }

  bool take_poses_from_edges() {
    auto& ids = graph_.ids;
    for (const auto& [from, to] : ends_) {
      ids.push_back(from);
      ids.push_back(to);
    }
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    if (!ids.empty()) return true;
    return fail(ErrorCode::bad_input, "expected VERTEX or EDGE lines, found none (is the file empty?)", 0);
  }

  template <class Edge>
  bool resolve_edges(const IdIndex& index, std::vector<Edge>& edges) {
    std::size_t kept = 0;
    for (std::size_t k = 0; k < edges.size(); ++k) {
      Edge& e = edges[k];
      e.from = index.find(ends_[k].first);
      e.to = index.find(ends_[k].second);
      if (e.from < 0 || e.to < 0)
        return fail(ErrorCode::bad_input,
                    "no VERTEX line has the id " + std::to_string(e.from < 0 ? ends_[k].first : ends_[k].second),
                    e.line);
      if (e.from == e.to)
        ++graph_.self_edges_left_out;
      else if (kept++ != k)
        edges[kept - 1] = e;
    }
    edges.resize(kept);
    return true;
  }

  TextScanner scanner_;
  PoseGraphFile graph_;
  bool dimension_known_ = false;
  std::vector<std::pair<std::int64_t, std::int64_t>> ends_;  // of each edge, as the file names them
  std::vector<FixLine> fixes_;
  Error error_;
};

void append(std::string& out, double value) {
  out += ' ';
  append_number(out, value);
}

void append(std::string& out, const Vec3d& v) {
  for (int i = 0; i < 3; ++i) append(out, v[i]);
}

void append(std::string& out, const SpatialPose& pose) {
  append(out, pose.t);
  for (double q : {pose.qx, pose.qy, pose.qz, pose.qw}) append(out, q);
}

template <class Pose>
void append_poses(std::string& out, std::string_view tag, const PoseGraphFile& graph, const std::vector<Pose>& poses) {
  for (std::size_t i = 0; i < poses.size(); ++i) {
    out += tag;
    out += ' ';
    append_number(out, graph.ids[i]);
    append(out, poses[i]);
    out += '\n';
  }
}

template <class Edge>
void append_edges(std::string& out, std::string_view tag, const PoseGraphFile& graph, const std::vector<Edge>& edges) {
  for (const Edge& e : edges) {
    out += tag;
    for (std::int32_t end : {e.from, e.to}) {
      out += ' ';
      append_number(out, graph.ids[static_cast<std::size_t>(end)]);
    }
    append(out, e.measurement);
    for (double value : e.information) append(out, value);
    out += '\n';
  }
}

}  // namespace

Mat3d information_matrix(const PoseGraphFile::PlanarEdge& edge) { return from_upper<3>(edge.information.data()); }
Mat6d information_matrix(const PoseGraphFile::SpatialEdge& edge) { return from_upper<6>(edge.information.data()); }

Result<PoseGraphFile> parse_g2o(std::string_view text, std::string file_name) {
  return Parser(text, std::move(file_name)).parse();
}

Result<PoseGraphFile> read_g2o(const std::string& path) {
  const Result<std::string> text = read_text_file(path);
  if (!text) return text.error();
  return parse_g2o(*text, path);
}

std::string format_g2o(const PoseGraphFile& graph) {
  std::string out;
  append_poses(out, kVertex2, graph, graph.planar_poses);
  append_poses(out, kVertex3, graph, graph.spatial_poses);
  for (std::int32_t i : graph.fixed) {
    out += "FIX ";
    append_number(out, graph.ids[static_cast<std::size_t>(i)]);
    out += '\n';
  }
  append_edges(out, kEdge2, graph, graph.planar_edges);
  append_edges(out, kEdge3, graph, graph.spatial_edges);
  return out;
}

Result<void> write_g2o(const std::string& path, const PoseGraphFile& graph) {
  return write_text_file(path, format_g2o(graph));
}

}  // namespace oriel
