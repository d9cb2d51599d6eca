// The two halves of reading a pose graph: lines as they stand, and what their ids mean. Private to this room.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "oriel/io/g2o.h"

namespace oriel::detail {

struct PoseGraphLines {
  struct Ends {
    std::int64_t first, second;
  };
  struct IdLine {
    std::int64_t id, line;
  };
  PoseGraphFile graph;                    // ids as they come; the ends of edges are not set
  std::vector<Ends> edges;                // of each pose-to-pose edge, as the file names them
  std::vector<Ends> sightings, bearings;  // pose and landmark of each
  std::vector<std::int64_t> offset_ids;   // of each spatial sighting
  std::vector<IdLine> fixes;
};

Result<PoseGraphLines> read_pose_graph_lines(std::string_view text, std::string file_name);

// What the last numbers of each edge mean: brings them to g2o's information, refuses or repairs what is indefinite.
// TORO's EDGE2 and iSAM's differ in the order of these numbers alone; `spelling` has been decided by then.
Result<void> settle_information(PoseGraphLines& lines, const PoseGraphReading& reading);

// TORO or iSAM, where EDGE2 lines alone do not say: the one in whose order all of them are information.
PoseGraphSpelling guess_spelling(const PoseGraphFile& graph);

// Ids to dense indices, in ascending order of id.
Result<PoseGraphFile> resolve_pose_graph(PoseGraphLines lines);

}  // namespace oriel::detail
