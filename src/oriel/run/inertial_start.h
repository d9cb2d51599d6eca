// The start of a window of an IMU and cameras, found by itself: at rest, or in motion from what two cameras see
// (window/initialise.h), as InertialOdometry finds it. The frames that were looked at go in afterwards.
#pragma once
#include <memory>

#include "oriel/run/window_parts.h"
#include "oriel/window/imu_provider.h"

namespace oriel {

struct InertialStartOptions {
  InertialOptions inertial;
  double moving_velocity_sigma = 0.5;  // of the first velocity of a start in motion [m/s]
};

// `imu` is the window's, and has the samples up to each frame; `noise` is what it goes by.
std::unique_ptr<WindowStart> make_inertial_start(ImuProvider& imu, const ImuNoise& noise, const SensorSuite& sensors,
                                                 const InitialisationOptions& initialisation,
                                                 const InertialStartOptions& options);

}  // namespace oriel
