#include "benchmarks/support/window_race.h"

namespace oriel::benchmark {

WindowData simulate(const SimulatedWindowOptions& options) {
  WindowData data{simulate_window(options), {}};
  data.imu_noise.resize(data.stream.keyframes.size());
  for (std::size_t k = 1; k < data.stream.keyframes.size(); ++k)
    data.imu_noise[k] = imu_noise(data.stream.keyframes[k].motion);
  return data;
}

FirstState first_state(const WindowData& data) {
  const SimulatedKeyframe& first = data.stream.keyframes.front();
  ImuBiasd bias = first.bias;
  for (int i = 0; i < 3; ++i) {
    bias.gyro[i] += (i - 1) * 0.2 * kStartGyroBias;
    bias.accel[i] -= (i - 1) * 0.2 * kStartAccelBias;
  }
  return {first.T_world_body, first.v, bias};
}

}  // namespace oriel::benchmark
