// Where the poses of a pose graph begin.
#pragma once
#include "oriel/io/problem.h"

namespace oriel::apps {

enum class StartChoice { automatic, file, odometry };

// ½Σρ(‖r‖²) over the file's edges with its poses there (`start`), whitened and robust as the options say.
double start_cost(const PoseGraphFile& file, const PoseGraphOptions& options, PoseStart start);

// automatic: whichever of the two costs less, and the file where they are equal. A file without VERTEX lines has its
// edges alone, whatever was asked for.
PoseStart choose_start(const PoseGraphFile& file, const PoseGraphOptions& options, StartChoice choice);

}  // namespace oriel::apps
