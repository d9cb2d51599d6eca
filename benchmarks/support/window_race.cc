#include "benchmarks/support/window_race.h"

namespace oriel::benchmark {

namespace {

// A stereo observation comes at once. Without stereo the anchor's own is no reprojection, and the others of the first
// three come together.
std::vector<std::vector<View>> make_views(const SimulatedWindow& stream, bool stereo) {
  std::vector<std::vector<View>> views(stream.keyframes.size());
  std::vector<std::vector<View>> held(stream.tracks.size());
  for (int k = 0; k < std::ssize(stream.keyframes); ++k)
    for (const SimulatedObservation& o : stream.keyframes[k].observations) {
      const int anchor = stream.tracks[o.track].anchor;
      std::vector<View>& waiting = held[o.track];
      if (stereo || k != anchor) waiting.push_back({o.track, k, &o});
      if (!stereo && k - anchor + 1 < kMonoObservations) continue;
      views[k].insert(views[k].end(), waiting.begin(), waiting.end());
      waiting.clear();
    }
  return views;
}

// The tracks of a frame between keyframes that the window has taken in by then.
std::vector<View> views_between(const SimulatedWindow& stream, int k, bool stereo) {
  std::vector<View> views;
  for (const SimulatedObservation& o : stream.between[k].observations)
    if (stereo || k - stream.tracks[o.track].anchor + 1 >= kMonoObservations) views.push_back({o.track, k + 1, &o});
  return views;
}

}  // namespace

WindowData simulate(const SimulatedWindowOptions& options, bool stereo) {
  WindowData data{simulate_window(options), {}, {}, {}, {}};
  data.views = make_views(data.stream, stereo);
  data.imu_noise.resize(data.stream.keyframes.size());
  for (std::size_t k = 1; k < data.stream.keyframes.size(); ++k)
    data.imu_noise[k] = imu_noise(data.stream.keyframes[k].motion);
  for (int k = 0; k < std::ssize(data.stream.between); ++k) {
    data.between_views.push_back(views_between(data.stream, k, stereo));
    data.between_noise.push_back(imu_noise(data.stream.between[k].motion));
  }
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
