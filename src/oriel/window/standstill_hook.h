// At rest an IMU's noise looks like motion, and one camera without parallax sees no scale: the estimate drifts away.
// Where the IMU, the speed that is believed and (if they are asked) the tracks all say that the body stands still, a
// new state gets two factors more: its velocity is zero, and its pose is that of the state before.
#pragma once
#include <cstdint>

#include "oriel/base/function.h"
#include "oriel/window/imu_provider.h"
#include "oriel/window/insertion_hook.h"

namespace oriel {

struct StandstillOptions {
  Duration span{500'000'000};    // of the IMU's samples before the new state that must be still [ns]
  double gyro = 0.03;            // their largest distance from their mean [rad/s]
  double accel = 0.3;            // [m/s²]
  double turn = 0.02;            // the mean itself, without the bias [rad/s]
  double speed = 0.3;            // that is believed; an even motion is rest to an IMU [m/s]
  double pixels = 1.5;           // by which tracks may move since the state before, in the median [px]
  double velocity_sigma = 0.01;  // of the factors [m/s]
  double rotation_sigma = 1e-3, translation_sigma = 1e-3;  // [rad] [m]
};

class StandstillHook final : public InsertionHook {
 public:
  // Median motion of the tracks that two times share, in pixels; negative where none are shared.
  using TrackMotion = Function<double(Time, Time)>;

  // `imu` is the provider's own (SlidingWindow keeps it), and outlives the hook.
  StandstillHook(ProviderId provider, const ImuProvider& imu, const StandstillOptions& options = {},
                 TrackMotion tracks = {})
      : provider_(provider), imu_(&imu), options_(options), tracks_(std::move(tracks)) {}

  std::string_view name() const override { return "standstill"; }
  Verdict inserted(const Graph& graph, const States& states, const InsertedGroup& group, GraphEdit& edit) override;
  std::int64_t count() const { return count_; }  // states that got its factors so far

  // Samples that do not differ from their mean, which is no rotation.
  static bool are_still(std::span<const ImuSample> samples, const ImuBiasd& bias, const StandstillOptions& options);

 private:
  ProviderId provider_;
  const ImuProvider* imu_;
  StandstillOptions options_;
  TrackMotion tracks_;
  std::int64_t count_ = 0;
};

}  // namespace oriel
