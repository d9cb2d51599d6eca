#include "oriel/io/problem_facts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "oriel/base/chi_squared.h"
#include "oriel/io/chain_odometry.h"
#include "oriel/io/information.h"
#include "oriel/io/landmarks.h"
#include "oriel/io/pose_start.h"
#include "oriel/residual/bal.h"
#include "oriel/residual/landmark2.h"
#include "oriel/residual/landmark3.h"
#include "oriel/residual/pose_graph.h"

namespace oriel {
namespace {

// Poses are nodes from 0 on, landmarks follow them.
struct Link {
  std::int32_t a, b;
  const char* tag;
  int dim;
  std::int64_t line;
  double squared;  // of its whitened residual
};

class Pieces {  // disjoint sets, by halving of paths
 public:
  explicit Pieces(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0); }
  std::size_t root(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  // The smaller index stays the root: it is the first node of its piece.
  void join(std::size_t a, std::size_t b) {
    a = root(a), b = root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

ProblemFacts::Spread spread_of(std::vector<std::size_t> degrees) {
  ProblemFacts::Spread s;
  if (degrees.empty()) return s;
  std::sort(degrees.begin(), degrees.end());
  s = {degrees.front(), degrees[degrees.size() / 2], degrees.back(), 0.0};
  s.mean = static_cast<double>(std::accumulate(degrees.begin(), degrees.end(), std::size_t{0})) /
           static_cast<double>(degrees.size());
  return s;
}

class Survey {
 public:
  Survey(std::size_t poses, std::size_t landmarks, std::vector<Link> links)
      : poses_(poses), nodes_(poses + landmarks), links_(std::move(links)) {}

  template <class Name>
  ProblemFacts facts(Name&& name) {
    degrees();
    repeated(name);
    far(name);
    for (const Link& l : links_) facts_.cost += 0.5 * l.squared;
    facts_.edges = links_.size();
    return std::move(facts_);
  }

  // What is held says what is free in the piece that it belongs to.
  template <class Name, class Free>
  void components(Name&& name, Free&& free) {
    Pieces pieces(nodes_);
    for (const Link& l : links_) pieces.join(static_cast<std::size_t>(l.a), static_cast<std::size_t>(l.b));
    std::map<std::size_t, ProblemFacts::Component> found;
    for (std::size_t i = 0; i < nodes_; ++i) {
      auto& c = found[pieces.root(i)];
      if (c.poses + c.landmarks == 0) c.first = name(i);
      ++(i < poses_ ? c.poses : c.landmarks);
    }
    for (auto& [root, c] : found) {
      c.free = free(pieces, root);
      facts_.components.push_back(std::move(c));
    }
    std::stable_sort(facts_.components.begin(), facts_.components.end(),
                     [](const auto& a, const auto& b) { return a.poses + a.landmarks > b.poses + b.landmarks; });
  }

  ProblemFacts facts_;

 private:
  void degrees() {
    std::vector<std::size_t> degree(nodes_, 0);
    for (const Link& l : links_) ++degree[static_cast<std::size_t>(l.a)], ++degree[static_cast<std::size_t>(l.b)];
    const auto middle = degree.begin() + static_cast<std::ptrdiff_t>(poses_);
    facts_.poses_alone = static_cast<std::size_t>(std::count(degree.begin(), middle, std::size_t{0}));
    facts_.landmarks_once = static_cast<std::size_t>(std::count(middle, degree.end(), std::size_t{1}));
    facts_.pose_degree = spread_of({degree.begin(), middle});
    facts_.landmark_degree = spread_of({middle, degree.end()});
  }

  template <class Name>
  ProblemFacts::Suspicion suspicion(const char* kind, const Link& l, Name& name, double sigmas = 0.0) {
    return {kind, l.line,
            std::string(l.tag) + " " + name(static_cast<std::size_t>(l.a)) + " " + name(static_cast<std::size_t>(l.b)),
            sigmas};
  }

  // The second and every later edge of a kind between two nodes, whichever way round.
  template <class Name>
  void repeated(Name& name) {
    std::vector<const Link*> order;
    order.reserve(links_.size());
    for (const Link& l : links_) order.push_back(&l);
    const auto key = [](const Link* l) { return std::make_pair(std::min(l->a, l->b), std::max(l->a, l->b)); };
    std::stable_sort(order.begin(), order.end(), [&](const Link* a, const Link* b) { return key(a) < key(b); });
    std::vector<const Link*> twice;
    for (std::size_t k = 1; k < order.size(); ++k)
      if (key(order[k]) == key(order[k - 1]) && order[k]->tag == order[k - 1]->tag) twice.push_back(order[k]);
    std::sort(twice.begin(), twice.end(), [](const Link* a, const Link* b) { return a->line < b->line; });
    if (!twice.empty()) facts_.suspicious.push_back({"repeated", twice.size()});
    for (std::size_t k = 0; k < std::min(twice.size(), ProblemFacts::kExamples); ++k)
      facts_.examples.push_back(suspicion("repeated", *twice[k], name));
  }

  static std::array<double, 7> thresholds() {
    std::array<double, 7> t{};
    for (int d = 1; d < 7; ++d) t[static_cast<std::size_t>(d)] = chi_squared_threshold(1.0 - kFarProbability, d);
    return t;
  }

  template <class Name>
  void far(Name& name) {
    static const std::array<double, 7> threshold = thresholds();
    std::vector<const Link*> out;
    for (const Link& l : links_)
      if (!(l.squared <= threshold[static_cast<std::size_t>(l.dim)]))
        out.push_back(&l);  // what is no number is far too
    std::stable_sort(out.begin(), out.end(), [](const Link* a, const Link* b) {
      return a->squared > b->squared || (std::isnan(a->squared) && !std::isnan(b->squared));
    });
    if (!out.empty()) facts_.suspicious.push_back({"far", out.size()});
    for (std::size_t k = 0; k < std::min(out.size(), ProblemFacts::kExamples); ++k)
      facts_.examples.push_back(suspicion("far", *out[k], name, std::sqrt(out[k]->squared)));
  }

  std::size_t poses_, nodes_;
  std::vector<Link> links_;
};

template <class Residual, class Edge, class... Value>
double squared_at(const Residual& residual, const Edge& e, const Value&... values) {
  Vec<double, Residual::kDim> r;
  return residual.evaluate(values..., r, nullptr, nullptr)
             ? squared_norm(r, from_upper<Residual::kDim>(e.information.data()))
             : 0.0;
}

std::vector<Link> links_of(const PoseGraphFile& f) {
  const bool g2o = f.spelling == PoseGraphSpelling::g2o;
  const auto landmark = [&](std::int32_t l) { return static_cast<std::int32_t>(f.ids.size()) + l; };
  std::vector<Link> links;
  if (f.is_3d) {
    std::vector<Pose3d> x;
    for (const auto& p : f.spatial_poses) x.push_back(pose_of(p));
    if (!f.has_vertices) x = chain_odometry3(f);
    const auto places = start_landmarks3(f, f.has_vertices, x);
    for (const auto& e : f.spatial_edges)
      links.push_back({e.from, e.to, g2o ? "EDGE_SE3:QUAT" : "EDGE3", 6, e.line,
                       squared_at(PoseGraphEdge3d{pose_of(e.measurement)}, e, x[e.from], x[e.to])});
    for (const auto& s : f.spatial_sightings)
      links.push_back({s.pose, landmark(s.landmark), g2o ? "EDGE_SE3_TRACKXYZ" : "POINT3", 3, s.line,
                       squared_at(Sighting3d{s.measurement}, s, x[s.pose], places[s.landmark],
                                  SensorPosed{pose_of(f.offsets[s.offset].T_body_sensor)})});
    return links;
  }
  std::vector<Pose2d> x;
  for (const auto& p : f.planar_poses) x.push_back(pose_of(p));
  if (!f.has_vertices) x = chain_odometry2(f);
  const auto places = start_landmarks2(f, f.has_vertices, x);
  for (const auto& e : f.planar_edges)
    links.push_back({e.from, e.to, g2o ? "EDGE_SE2" : "EDGE2", 3, e.line,
                     squared_at(PoseGraphEdge2d{pose_of(e.measurement)}, e, x[e.from], x[e.to])});
  for (const auto& s : f.planar_sightings)
    links.push_back({s.pose, landmark(s.landmark), g2o ? "EDGE_SE2_XY" : "LANDMARK", 2, s.line,
                     squared_at(Sighting2d{s.measurement}, s, x[s.pose], places[s.landmark])});
  for (const auto& b : f.planar_bearings)
    links.push_back({b.pose, landmark(b.landmark), "EDGE_BEARING_SE2_XY", 1, b.line,
                     squared_at(Bearing2d{b.measurement}, b, x[b.pose], places[b.landmark])});
  return links;
}

void count(ProblemFacts& facts, const char* what, std::size_t n) {
  if (n > 0) facts.counts.push_back({what, n});
}

void count_types(const PoseGraphFile& f, ProblemFacts& facts) {
  const auto odometry = [](const auto& edges) {
    return static_cast<std::size_t>(
        std::count_if(edges.begin(), edges.end(), [](const auto& e) { return std::abs(e.from - e.to) == 1; }));
  };
  const std::size_t edges = f.planar_edges.size() + f.spatial_edges.size();
  const std::size_t near = odometry(f.planar_edges) + odometry(f.spatial_edges);
  count(facts, "poses", f.ids.size());
  count(facts, "landmarks", f.landmark_ids.size());
  count(facts, "edges between poses that follow one another", near);
  count(facts, "edges that close loops", edges - near);
  count(facts, "sightings of landmarks", f.planar_sightings.size() + f.spatial_sightings.size());
  count(facts, "bearings of landmarks", f.planar_bearings.size());
  count(facts, "sensor offsets", f.offsets.size());
  count(facts, "poses held by FIX", f.fixed.size());
  count(facts, "landmarks held by FIX", f.fixed_landmarks.size());
}

void lines_as_examples(const char* kind, const std::vector<std::int64_t>& lines, ProblemFacts& facts) {
  if (lines.empty()) return;
  facts.suspicious.push_back({kind, lines.size()});
  for (std::size_t k = 0; k < std::min(lines.size(), ProblemFacts::kExamples); ++k)
    facts.examples.push_back({kind, lines[k], "", 0.0});
}

}  // namespace

ProblemFacts facts_of(const PoseGraphFile& f) {
  const auto name = [&](std::size_t i) {
    return std::to_string(i < f.ids.size() ? f.ids[i] : f.landmark_ids[i - f.ids.size()]);
  };
  Survey survey(f.ids.size(), f.landmark_ids.size(), links_of(f));
  count_types(f, survey.facts_);
  survey.facts_.start = f.has_vertices ? "file" : "odometry";
  lines_as_examples("self", f.self_edge_lines, survey.facts_);
  lines_as_examples("indefinite", f.repaired_lines, survey.facts_);
  survey.components(
      [&](std::size_t i) { return (i < f.ids.size() ? "pose " : "landmark ") + name(i); },
      [&](Pieces& pieces, std::size_t root) -> std::string {
        const auto in = [&](std::size_t node) { return pieces.root(node) == root; };
        if (std::any_of(f.fixed.begin(), f.fixed.end(), [&](auto i) { return in(static_cast<std::size_t>(i)); }))
          return "";
        const auto held = std::count_if(f.fixed_landmarks.begin(), f.fixed_landmarks.end(),
                                        [&](auto l) { return in(f.ids.size() + static_cast<std::size_t>(l)); });
        if (held == 0) return f.is_3d ? "translation and rotation (6)" : "translation and rotation (3)";
        return held >= (f.is_3d ? 3 : 2) ? "" : "rotation about what FIX holds";
      });
  return survey.facts(name);
}

ProblemFacts facts_of(const BalFile& f) {
  const std::size_t cameras = f.cameras.size();
  std::vector<BalCamerad> values;
  for (const auto& c : f.cameras) {
    Vec<double, 9> v;
    for (int k = 0; k < 9; ++k) v[k] = c[k];
    values.push_back(BalCamerad::from_file(v));
  }
  std::vector<Link> links;
  links.reserve(f.observations.size());
  std::size_t behind = 0;
  for (const auto& o : f.observations) {
    const BalCamerad& c = values[o.camera];
    const Point3d X{f.points[o.point]};
    Vec2d r;
    BalReprojectiond{{{o.u, o.v}}}.evaluate(c, X, r, nullptr, nullptr);
    behind += (c.R_camera_world * X.p + c.t)[2] >= 0;
    links.push_back(
        {o.camera, static_cast<std::int32_t>(cameras) + o.point, "observation", 2, o.line, r.squared_norm()});
  }
  const auto name = [&](std::size_t i) {
    return i < cameras ? "camera " + std::to_string(i) : "point " + std::to_string(i - cameras);
  };
  Survey survey(cameras, f.points.size(), std::move(links));
  count(survey.facts_, "cameras", cameras);
  count(survey.facts_, "points", f.points.size());
  count(survey.facts_, "observations", f.observations.size());
  count(survey.facts_, "observations of points behind their camera", behind);
  survey.facts_.start = "file";
  survey.components(name, [](Pieces&, std::size_t) { return std::string("translation, rotation and scale (7)"); });
  return survey.facts(name);
}

}  // namespace oriel
