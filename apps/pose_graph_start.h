// Which start a pose graph is solved from.
#pragma once
#include <string>
#include <vector>

#include "oriel/io/problem.h"

namespace oriel::apps {

enum class StartChoice { automatic, file, odometry, spanning_tree, chordal };

struct PoseGraphStart {
  PoseStart kind = PoseStart::file;
  double cost = 0.0;            // ½Σρ(‖r‖²) there, whitened and robust as the options say
  std::vector<Pose2d> planar;   // of a file of the plane
  std::vector<Pose3d> spatial;  // of one of space
};

// Its poses and their cost; an Error where there is no such start.
Result<PoseGraphStart> find_start(const PoseGraphFile& file, const PoseGraphOptions& options, PoseStart kind);

// automatic: whichever costs least, and the one further up in PoseStart where two are equal. A file without VERTEX
// lines has its edges alone.
Result<PoseGraphStart> choose_start(const PoseGraphFile& file, const PoseGraphOptions& options, StartChoice choice);

const char* name_of(PoseStart start);

// Of a word of --init (arguments.h): auto, or the name of a start.
StartChoice start_choice(const std::string& word);

}  // namespace oriel::apps
