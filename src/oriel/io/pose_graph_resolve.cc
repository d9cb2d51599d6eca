// From the ids of a file to dense indices.
#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "oriel/io/pose_graph_lines.h"

namespace oriel::detail {
namespace {

// A table where the ids are dense, else binary search.
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
      return id >= 0 && id < static_cast<std::int64_t>(table_.size()) ? table_[static_cast<std::size_t>(id)] : -1;
    const auto it = std::lower_bound(ids_.begin(), ids_.end(), id);
    return it != ids_.end() && *it == id ? static_cast<std::int32_t>(it - ids_.begin()) : -1;
  }

 private:
  const std::vector<std::int64_t>& ids_;
  std::vector<std::int32_t> table_;
};

template <class T>
void permute(const std::vector<std::size_t>& order, std::vector<T>& values) {
  if (values.empty()) return;
  std::vector<T> sorted;
  sorted.reserve(values.size());
  for (std::size_t i : order) sorted.push_back(values[i]);
  values.swap(sorted);
}

// Sorts ids, and what belongs to them with them.
template <class... Values>
void sort_by_id(std::vector<std::int64_t>& ids, Values&... values) {
  if (std::is_sorted(ids.begin(), ids.end())) return;
  std::vector<std::size_t> order(ids.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return ids[a] < ids[b]; });
  permute(order, ids);
  (permute(order, values), ...);
}

void sort_unique(std::vector<std::int64_t>& ids) {
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

class Resolver {
 public:
  explicit Resolver(PoseGraphLines lines) : lines_(std::move(lines)), g_(lines_.graph) {}

  Result<PoseGraphFile> resolve() {
    g_.has_vertices = !g_.ids.empty() || !g_.landmark_ids.empty();
    if (!(g_.has_vertices ? sort_declared() : take_from_edges()) || !few_enough()) return error_;
    const IdIndex poses(g_.ids), landmarks(g_.landmark_ids);
    if (!resolve_edges(poses, g_.planar_edges) || !resolve_edges(poses, g_.spatial_edges)) return error_;
    const auto both = [&](auto& list, const auto& ends) { return resolve_sightings(poses, landmarks, list, ends); };
    if (!both(g_.planar_sightings, lines_.sightings) || !both(g_.planar_bearings, lines_.bearings) ||
        !both(g_.spatial_sightings, lines_.sightings))
      return error_;
    if (!resolve_offsets() || !resolve_fixes(poses, landmarks)) return error_;
    return std::move(g_);
  }

 private:
  bool shared_ids() const { return g_.spelling != PoseGraphSpelling::isam; }

  bool sort_declared() {
    sort_by_id(g_.ids, g_.pose_lines, g_.planar_poses, g_.spatial_poses);
    sort_by_id(g_.landmark_ids, g_.landmark_lines, g_.planar_landmarks, g_.spatial_landmarks);
    return each_once("pose", g_.ids, g_.pose_lines) && each_once("landmark", g_.landmark_ids, g_.landmark_lines) &&
           (!shared_ids() || disjoint());
  }

  bool each_once(const char* what, const std::vector<std::int64_t>& ids, const std::vector<std::int64_t>& id_lines) {
    const auto twice = std::adjacent_find(ids.begin(), ids.end());
    if (twice == ids.end()) return true;
    const auto i = static_cast<std::size_t>(twice - ids.begin());
    return fail(ErrorCode::duplicate,
                std::string("expected each ") + what + " once, found the id " + std::to_string(*twice) +
                    " again (first in line " + std::to_string(id_lines[i]) + ")",
                id_lines[i + 1]);
  }

  // Both are ascending.
  bool disjoint() {
    const auto &a = g_.ids, &b = g_.landmark_ids;
    for (std::size_t i = 0, k = 0; i < a.size() && k < b.size();) {
      if (a[i] == b[k])
        return fail(ErrorCode::duplicate, "the id " + std::to_string(a[i]) + " is a pose's and a landmark's",
                    g_.landmark_lines.empty() ? 0 : std::max(g_.pose_lines[i], g_.landmark_lines[k]));
      ++(a[i] < b[k] ? i : k);
    }
    return true;
  }

  bool take_from_edges() {
    for (const auto& e : lines_.edges) g_.ids.insert(g_.ids.end(), {e.first, e.second});
    for (const auto* list : {&lines_.sightings, &lines_.bearings})
      for (const auto& e : *list) {
        g_.ids.push_back(e.first);
        g_.landmark_ids.push_back(e.second);
      }
    sort_unique(g_.ids);
    sort_unique(g_.landmark_ids);
    if (!g_.ids.empty()) return !shared_ids() || disjoint();
    return fail(ErrorCode::bad_input, "expected VERTEX or EDGE lines, found none (is the file empty?)", 0);
  }

  bool few_enough() {
    if (g_.ids.empty()) return fail(ErrorCode::bad_input, "expected poses, found landmarks alone", 0);
    constexpr auto kMost = static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max());
    return std::max(g_.ids.size(), g_.landmark_ids.size()) <= kMost ||
           fail(ErrorCode::bad_input, "expected at most 2147483647 poses and as many landmarks", 0);
  }

  template <class Edge>
  bool resolve_edges(const IdIndex& index, std::vector<Edge>& edges) {
    std::size_t kept = 0;
    for (std::size_t k = 0; k < edges.size(); ++k) {
      Edge& e = edges[k];
      const auto& ends = lines_.edges[k];
      e.from = index.find(ends.first);
      e.to = index.find(ends.second);
      if (e.from < 0 || e.to < 0) return no_pose(e.from < 0 ? ends.first : ends.second, e.line);
      if (e.from == e.to)
        ++g_.self_edges_left_out, g_.self_edge_lines.push_back(e.line);
      else if (kept++ != k)
        edges[kept - 1] = e;
    }
    edges.resize(kept);
    return true;
  }

  template <class Sighting>
  bool resolve_sightings(const IdIndex& poses, const IdIndex& landmarks, std::vector<Sighting>& list,
                         const std::vector<PoseGraphLines::Ends>& ends) {
    for (std::size_t k = 0; k < list.size(); ++k) {
      list[k].pose = poses.find(ends[k].first);
      list[k].landmark = landmarks.find(ends[k].second);
      if (list[k].pose < 0) return no_pose(ends[k].first, list[k].line);
      if (list[k].landmark < 0)
        return fail(ErrorCode::bad_input, missing(ends[k].second, "landmark", g_.ids), list[k].line);
    }
    return true;
  }

  bool no_pose(std::int64_t id, std::int64_t line) {
    return fail(ErrorCode::bad_input, missing(id, "pose", g_.landmark_ids), line);
  }

  static std::string missing(std::int64_t id, const char* wanted, const std::vector<std::int64_t>& others) {
    if (std::binary_search(others.begin(), others.end(), id))
      return std::string("expected a ") + wanted + " with the id " + std::to_string(id) + ", found that it is none";
    return "no VERTEX line has the id " + std::to_string(id);
  }

  bool resolve_offsets() {
    auto& offsets = g_.offsets;
    std::stable_sort(offsets.begin(), offsets.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
    for (std::size_t i = 1; i < offsets.size(); ++i)
      if (offsets[i].id == offsets[i - 1].id)
        return fail(ErrorCode::duplicate,
                    "expected each PARAMS_SE3OFFSET once, found the id " + std::to_string(offsets[i].id) +
                        " again (first in line " + std::to_string(offsets[i - 1].line) + ")",
                    offsets[i].line);
    if (!shared_ids() && !g_.spatial_sightings.empty()) offsets.push_back({0, {{0, 0, 0}, 0, 0, 0, 1}, 0});
    for (std::size_t k = 0; k < g_.spatial_sightings.size(); ++k) {
      auto& s = g_.spatial_sightings[k];
      const std::int64_t id = std::max<std::int64_t>(lines_.offset_ids[k], 0);
      const auto it = std::lower_bound(offsets.begin(), offsets.end(), id,
                                       [](const auto& o, std::int64_t wanted) { return o.id < wanted; });
      if (it == offsets.end() || it->id != id)
        return fail(ErrorCode::bad_input, "no PARAMS_SE3OFFSET line has the id " + std::to_string(id), s.line);
      s.offset = static_cast<std::int32_t>(it - offsets.begin());
    }
    return true;
  }

  bool resolve_fixes(const IdIndex& poses, const IdIndex& landmarks) {
    for (const auto& f : lines_.fixes) {
      const std::int32_t pose = poses.find(f.id), landmark = shared_ids() ? landmarks.find(f.id) : -1;
      if (pose < 0 && landmark < 0)
        return fail(ErrorCode::bad_input, "FIX: no pose has the id " + std::to_string(f.id), f.line);
      (pose >= 0 ? g_.fixed : g_.fixed_landmarks).push_back(pose >= 0 ? pose : landmark);
    }
    for (auto* list : {&g_.fixed, &g_.fixed_landmarks}) {
      std::sort(list->begin(), list->end());
      list->erase(std::unique(list->begin(), list->end()), list->end());
    }
    return true;
  }

  bool fail(ErrorCode code, std::string message, std::int64_t line) {
    error_ = {code, std::move(message), g_.file_name, line};
    return false;
  }

  PoseGraphLines lines_;
  PoseGraphFile& g_;
  Error error_;
};

}  // namespace

Result<PoseGraphFile> resolve_pose_graph(PoseGraphLines lines) { return Resolver(std::move(lines)).resolve(); }

}  // namespace oriel::detail
