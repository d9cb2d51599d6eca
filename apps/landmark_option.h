// --landmarks of run, soak and nees.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "oriel/run/words.h"

namespace oriel::apps {

inline std::vector<std::string> landmark_words() { return landmark_models().list(); }

// Of one of these words.
inline LandmarkModel landmark_model(std::string_view word) { return *landmark_models().find(word); }

}  // namespace oriel::apps
