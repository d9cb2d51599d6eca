// What must hold of the readers for any bytes: they end, in an Error of one short line or in a value that keeps its
// promises, and what is written of it reads back to the same. libFuzzer drives these functions for as long as one likes
// (./test --fuzz), the tests for a moment.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

#include "oriel/io/bal.h"
#include "oriel/io/drawing.h"
#include "oriel/io/g2o.h"
#include "oriel/io/information.h"
#include "oriel/io/problem_facts.h"
#include "oriel/io/problem_format.h"
#include "oriel/io/problem_text.h"
#include "oriel/io/recording.h"
#include "oriel/io/tum.h"
#include "oriel/io/visual_map_file.h"

namespace oriel::fuzz {

// Not assert: it must end the program in a release too, which is how both drivers learn of it.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "a reader broke its promise: %s\n", what);
  std::abort();
}

inline void require_short_line(const Error& error) {
  const std::string text = error.text();
  require(!error.message.empty() && text.size() < 400, "an error is short");
  require(std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; }), "an error is one line");
}

inline void require_places(const std::vector<std::int64_t>& ids) {
  require(std::adjacent_find(ids.begin(), ids.end(), std::greater_equal<>()) == ids.end(), "ids ascend, each once");
  require(ids.empty() || ids.front() >= 0, "ids are not negative");
}

template <int N, class Edge>
void require_edge(const Edge& e, std::int32_t a, std::size_t as, std::int32_t b, std::size_t bs) {
  require(a >= 0 && static_cast<std::size_t>(a) < as && b >= 0 && static_cast<std::size_t>(b) < bs, "ends are there");
  require(positive_semidefinite(e.information.data(), N), "information is semidefinite");
  for (const double x : e.information) require(std::isfinite(x), "information is finite");
}

inline void require_promises(const PoseGraphFile& g) {
  const std::size_t poses = g.ids.size(), landmarks = g.landmark_ids.size();
  require(poses > 0, "there is a pose");
  require_places(g.ids);
  require_places(g.landmark_ids);
  for (const auto& e : g.planar_edges) require_edge<3>(e, e.from, poses, e.to, poses);
  for (const auto& e : g.spatial_edges) require_edge<6>(e, e.from, poses, e.to, poses);
  for (const auto& s : g.planar_sightings) require_edge<2>(s, s.pose, poses, s.landmark, landmarks);
  for (const auto& s : g.planar_bearings) require_edge<1>(s, s.pose, poses, s.landmark, landmarks);
  for (const auto& s : g.spatial_sightings) {
    require_edge<3>(s, s.pose, poses, s.landmark, landmarks);
    require(s.offset >= 0 && static_cast<std::size_t>(s.offset) < g.offsets.size(), "the sensor is there");
  }
  for (const auto& p : g.spatial_poses)
    require(std::abs(p.qx * p.qx + p.qy * p.qy + p.qz * p.qz + p.qw * p.qw - 1) < 1e-9, "quaternions are of unit norm");
  for (const std::int32_t i : g.fixed) require(i >= 0 && static_cast<std::size_t>(i) < poses, "FIX names a pose");
  if (g.has_vertices)
    require((g.is_3d ? g.spatial_poses.size() : g.planar_poses.size()) == poses, "each pose has a value");
}

// Writing forgets where lines stood and in what spelling, and nothing else.
inline void require_same_again(const PoseGraphFile& g) {
  if (!g.landmark_ids.empty() && !g.has_vertices && g.spelling == PoseGraphSpelling::isam)
    return;                                                                          // ids may be shifted
  if (g.planar_edges.empty() && g.spatial_edges.empty() && !g.has_vertices) return;  // a lone pose has no line
  const std::string once = format_g2o(g);
  PoseGraphReading reading;
  reading.project_information = true;
  const auto again = parse_g2o(once, "again", reading);
  require(again.ok(), "what is written reads");
  require(again->planar_edges.size() == g.planar_edges.size() && again->spatial_edges.size() == g.spatial_edges.size(),
          "no edge is lost");
  require(again->planar_sightings.size() + again->planar_bearings.size() + again->spatial_sightings.size() ==
              g.planar_sightings.size() + g.planar_bearings.size() + g.spatial_sightings.size(),
          "no sighting is lost");
  require(format_g2o(*parse_g2o(format_g2o(*again), "twice", reading)).size() > 0, "what is read writes");
}

inline void pose_graph(std::string_view bytes) {
  for (const bool project : {false, true})
    for (const IsamNoise noise : {IsamNoise::information, IsamNoise::root, IsamNoise::covariance}) {
      if (project != (noise != IsamNoise::information)) continue;  // three of the six, for speed
      PoseGraphReading reading;
      reading.project_information = project;
      reading.isam_noise = noise;
      const auto graph = parse_g2o(bytes, "f", reading);
      if (!graph) {
        require_short_line(graph.error());
        continue;
      }
      require_promises(*graph);
      require_same_again(*graph);
      const ProblemFacts facts = facts_of(*graph);
      require(!facts.components.empty(), "every pose is in a piece");
      if (!graph->has_vertices) continue;
      const Drawing drawing = drawing_of(*graph);
      require(format_ply(drawing).size() + format_svg("f", drawing, drawing).size() > 0, "it can be drawn");
    }
}

inline void bal(std::string_view bytes) {
  const auto file = parse_bal(bytes, "f");
  if (!file) return require_short_line(file.error());
  for (const auto& o : file->observations)
    require(o.camera >= 0 && static_cast<std::size_t>(o.camera) < file->cameras.size() && o.point >= 0 &&
                static_cast<std::size_t>(o.point) < file->points.size(),
            "observations are of cameras and points that are there");
  const std::string once = format_bal(*file);
  const auto again = parse_bal(once, "again");
  require(again.ok() && format_bal(*again) == once, "what is written reads back to the same bits");
  require(facts_of(*file).edges == file->observations.size(), "every observation is counted");
  const Drawing drawing = drawing_of(*file);
  require(format_svg("f", drawing, drawing).size() > 0, "it can be drawn");
}

inline void packed(std::string_view bytes) {
  ProblemText text;
  bytes.copy(text.grow(bytes.size() + 1), bytes.size());
  text.advance(bytes.size());
  const auto out = unpack(std::move(text), "f");
  if (!out) return require_short_line(out.error());
  const auto format = detect_format(out->view(), "f");
  if (!format) require_short_line(format.error());
}

inline void tables(std::string_view bytes) {
  const auto judge = [](const auto& result) {
    if (!result) require_short_line(result.error());
  };
  judge(parse_trajectory(bytes, "f"));
  judge(parse_imu_csv(bytes, "f"));
  judge(parse_tracks_csv(bytes, "f", 2));
  judge(parse_groundtruth(bytes, "f"));
}

inline void visual_map(std::string_view bytes) {
  const auto map = parse_visual_map(bytes, "f");
  if (!map) {
    require(map.error().line > 0, "an error has a line");
    return require_short_line(map.error());
  }
  require(map->check().ok(), "a map fits together");
  const std::string once = format_visual_map(*map);
  const auto again = parse_visual_map(once, "again");
  require(again.ok() && format_visual_map(*again) == once, "what is written reads back to the same bits");
}

}  // namespace oriel::fuzz
