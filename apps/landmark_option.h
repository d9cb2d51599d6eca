// --landmarks of run, soak and nees.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "oriel/window/odometry_options.h"

namespace oriel::apps {

inline const std::vector<std::string> kLandmarkModels = {"by-cameras", "inverse-depth", "point"};

// Of one of these words.
inline LandmarkModel landmark_model(std::string_view word) {
  return word == "point"           ? LandmarkModel::point
         : word == "inverse-depth" ? LandmarkModel::inverse_depth
                                   : LandmarkModel::by_cameras;
}

}  // namespace oriel::apps
