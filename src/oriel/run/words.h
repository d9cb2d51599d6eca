// Words of enumerations that configs and command lines both take.
#pragma once
#include "oriel/run/name_table.h"
#include "oriel/run/two_frame_task.h"
#include "oriel/window/odometry_options.h"

namespace oriel {

NameTable<LandmarkModel> landmark_models();
NameTable<MatchResidual> match_residuals();
NameTable<MatchCoordinates> match_coordinates();
NameTable<MatchSource> match_sources();

}  // namespace oriel
