// An inertial measurement unit: what it measures, and how badly.
#pragma once
#include "oriel/base/matrix.h"
#include "oriel/base/time.h"

namespace oriel {

// One reading in the body's frame, which is the IMU's. At rest accel is minus gravity: it points up.
struct ImuSample {
  Time time;
  Vec3d gyro;   // angular velocity [rad/s]
  Vec3d accel;  // specific force [m/s²]
};

// Densities of white noise and of the biases' random walks, as data sheets and Kalibr give them. All > 0.
struct ImuNoise {
  double gyro = 0.0;        // [rad/s/√Hz]
  double accel = 0.0;       // [m/s²/√Hz]
  double gyro_walk = 0.0;   // [rad/s²/√Hz]
  double accel_walk = 0.0;  // [m/s³/√Hz]
};

// Gravity is a vector in the world's frame, so that its direction is no convention.
inline constexpr Vec3d kStandardGravity = {{0.0, 0.0, -9.81}};  // [m/s²]

}  // namespace oriel
