// The cameras of a recording as the library has them.
#pragma once
#include "oriel/io/recording.h"
#include "oriel/sensor/stereo_rig.h"

namespace oriel::apps {

// Of the first two; where there is one, the second is a default.
StereoRigd rig_of(const Recording& recording);

}  // namespace oriel::apps
