// Memory for a steady window, asked for before the first frame: a window as full as the options allow is built, solved,
// gated, marginalized and cleared, by the same code that will do it later. What then grows no more needs no list
// of who holds memory, and none that a later change could forget.
#pragma once
#include "oriel/sensor/stereo_rig.h"
#include "oriel/window/odometry_options.h"
#include "oriel/window/window_core.h"

namespace oriel {

struct WindowSize {
  int states = 14;
  int tracks = 300;  // in a frame
  LandmarkModel landmarks = LandmarkModel::inverse_depth;
  bool holds_rest = false;  // states at rest are held
};

// The window must be empty, and nobody may follow it yet. It is empty afterwards, its engine as new but for its memory.
// False where an edit or a solve was refused: then memory is asked for later, and nothing else is lost.
bool rehearse(WindowCore& window, const StereoRigd& rig, const WindowSize& size);

}  // namespace oriel
