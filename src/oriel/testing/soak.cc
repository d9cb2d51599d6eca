#include "oriel/testing/soak.h"

#include <sys/resource.h>
#include <time.h>  // NOLINT(modernize-deprecated-headers): clock_gettime is POSIX
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "oriel/base/percentile.h"

namespace oriel {
namespace {

using Kind = SimulatedFaultKind;
using Sensor = SimulatedSensor;

constexpr double kSettle = 6.0;         // after a fault, until it is judged [s]
constexpr double kMotion = 1.0;         // over which the error of the motion is taken [s]
constexpr double kLargestError = 0.10;  // of that motion, to have survived [m]
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Planned {
  const char* name;
  double from_s, length_s;  // in the cycle
  Sensor sensor;
  Kind kind;
  double share;
};
constexpr Planned kPlan[] = {
    {"IMU samples that are not numbers", 12, 1, Sensor::imu, Kind::not_a_number, 0.02},
    {"features that are not numbers", 22, 1, Sensor::camera, Kind::not_a_number, 1.0},
    {"repeated stamps of the IMU", 32, 1, Sensor::imu, Kind::repeated_stamp, 0.05},
    {"backward stamps of the IMU", 42, 1, Sensor::imu, Kind::backward_stamp, 0.05},
    {"repeated stamps of frames", 52, 1, Sensor::camera, Kind::repeated_stamp, 0.3},
    {"backward stamps of frames", 62, 1, Sensor::camera, Kind::backward_stamp, 0.3},
    {"no IMU samples", 72, 0.5, Sensor::imu, Kind::dropout, 1.0},
    {"no frames", 82, 1, Sensor::camera, Kind::dropout, 1.0},
    {"a blind camera", 92, 5, Sensor::camera, Kind::blind, 1.0},
    {"features that are all outliers", 106, 1, Sensor::camera, Kind::outlier, 1.0},
    {"a saturated IMU", 116, 1, Sensor::imu, Kind::saturation, 1.0},
};
constexpr Interval kRest = {128.0, 188.0};  // in the cycle: no motion

double thread_cpu_ms() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

double resident_mb() {
  long total = 0, resident = 0;
  if (std::FILE* f = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(f, "%ld %ld", &total, &resident) != 2) resident = 0;
    std::fclose(f);
  }
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) * 1e-6;
}

SimulatedWorldOptions world_options(const SoakOptions& o, double seconds) {
  SimulatedWorldOptions w;
  w.seed = o.seed;
  w.seconds = seconds;
  w.memory_s = 10.0;  // longer than anything is judged back
  w.cameras.timing.rate_hz = o.camera_rate_hz;
  w.cameras.tracks = o.tracks;
  w.cameras.stereo = o.stereo;
  w.rests.push_back({0.0, 2.0});
  if (!o.faults) return w;
  for (double begin = 0.0; begin < seconds; begin += kSoakCycle) {
    for (const Planned& p : kPlan)
      w.faults.push_back({p.kind, p.sensor, {begin + p.from_s, begin + p.from_s + p.length_s}, p.share});
    w.rests.push_back({begin + kRest.from_s, begin + kRest.to_s});
  }
  return w;
}

class Soak {
 public:
  Soak(const SoakOptions& options, SimulatedWorld&& world)
      : options_(options),
        world_(std::move(world)),
        odometry_(world_.rig(), options.stereo, world_.options().imu.noise, options.odometry) {
    if (options.faults) report_.faults = soak_plan(world_.seconds());
    per_slice_ = std::max<std::int64_t>(1, options.updates / std::max(1, options.slices));
    milliseconds_.reserve(static_cast<std::size_t>(per_slice_));
  }

  SoakReport run(const Function<void(const SoakReport&)>& progress) {
    for (SimulatedMeasurement m; report_.updates < options_.updates && world_.next(m);) {
      if (m.sensor == Sensor::imu && !odometry_.add_imu(m.imu)) ++report_.refused_samples;
      if (m.sensor != Sensor::camera) continue;
      update(m);
      judge_faults((m.time - world_.options().start).seconds());
      if (static_cast<std::int64_t>(milliseconds_.size()) < per_slice_) continue;
      close_slice();
      if (progress) progress(report_);
    }
    if (!milliseconds_.empty()) close_slice();
    return std::move(report_);
  }

 private:
  void update(const SimulatedMeasurement& m) {
    const std::int64_t allocations = allocation_count();
    const double began = thread_cpu_ms();
    const UpdateReport report = odometry_.update({m.stamp, m.features});
    milliseconds_.push_back(thread_cpu_ms() - began);
    allocations_ += allocation_count() - allocations;
    ++report_.updates;
    const bool tracking =
        report.status == UpdateReport::Status::tracking || report.status == UpdateReport::Status::initialised;
    report_.tracking += tracking;
    report_.failed += report.status == UpdateReport::Status::failed;
    if (report.reset[0] != '\0') count_reset(report.reset, (m.time - world_.options().start).seconds());
    if (tracking) remember(report);
  }

  void count_reset(const char* reason, double t) {
    auto at = std::find_if(report_.resets.begin(), report_.resets.end(), [&](auto& r) { return r.first == reason; });
    if (at == report_.resets.end()) at = report_.resets.insert(at, {reason, 0});
    ++at->second;
    for (SoakFault& f : report_.faults)
      if (f.when.from_s <= t && t <= f.when.to_s + kSettle) f.reason = reason;
    recent_.clear();
  }

  std::int64_t allocation_count() const { return options_.allocations ? options_.allocations() : 0; }

  // Estimates of the last second, oldest first.
  void remember(const UpdateReport& report) {
    recent_.push_back({report.time, report.values.T_world_body});
    while (recent_.size() > 2 && (recent_.back().time - recent_[1].time).seconds() >= kMotion - 1e-9)
      recent_.erase(recent_.begin());
  }

  // What it says of the last second's motion against the truth. NaN where it said nothing just now.
  double motion_error(double now) const {
    if (recent_.size() < 2) return kNaN;
    const StampedPose &a = recent_.front(), &b = recent_.back();
    const double newest = (b.time - world_.options().start).seconds();
    if (now - newest > 0.5 || (b.time - a.time).seconds() > 2.0 * kMotion) return kNaN;
    const Pose3d said = a.T_world_body.inverse() * b.T_world_body;
    const Pose3d was = world_.truth(a.time).T_world_body.inverse() * world_.truth(b.time).T_world_body;
    return (said.t - was.t).norm();
  }

  void judge_faults(double now) {
    for (; judged_ < report_.faults.size() && report_.faults[judged_].when.to_s + kSettle <= now; ++judged_) {
      SoakFault& f = report_.faults[judged_];
      f.error_m = motion_error(now);
      if (!f.reason.empty())
        f.outcome = SoakFault::Outcome::reset;
      else
        f.outcome = f.error_m <= kLargestError ? SoakFault::Outcome::survived : SoakFault::Outcome::lost;
    }
  }

  void close_slice() {
    std::sort(milliseconds_.begin(), milliseconds_.end());
    SoakSlice s;
    s.updates = static_cast<std::int64_t>(milliseconds_.size());
    s.allocations = allocations_;
    s.p50_ms = percentile(milliseconds_, 0.5);
    s.p99_ms = percentile(milliseconds_, 0.99);
    s.p999_ms = percentile(milliseconds_, 0.999);
    s.max_ms = milliseconds_.back();
    s.resident_mb = resident_mb();
    report_.slices.push_back(s);
    milliseconds_.clear();
    allocations_ = 0;
  }

  SoakOptions options_;
  SimulatedWorld world_;
  InertialOdometry odometry_;
  SoakReport report_;
  std::int64_t per_slice_ = 0, allocations_ = 0;
  std::vector<double> milliseconds_;
  std::vector<StampedPose> recent_;
  std::size_t judged_ = 0;
};

}  // namespace

std::vector<SoakFault> soak_plan(double seconds) {
  std::vector<SoakFault> plan;
  for (double begin = 0.0; begin < seconds; begin += kSoakCycle) {
    for (const Planned& p : kPlan)
      plan.push_back({p.name, {begin + p.from_s, begin + p.from_s + p.length_s}, SoakFault::Outcome::lost, "", kNaN});
    plan.push_back({"no motion", {begin + kRest.from_s, begin + kRest.to_s}, SoakFault::Outcome::lost, "", kNaN});
  }
  while (!plan.empty() && plan.back().when.to_s + kSettle > seconds - 1.0) plan.pop_back();
  return plan;
}

int SoakReport::count(SoakFault::Outcome outcome) const {
  return static_cast<int>(
      std::count_if(faults.begin(), faults.end(), [&](const SoakFault& f) { return f.outcome == outcome; }));
}

double SoakReport::latency_growth() const {
  return slices.size() < 3 ? kNaN : slices.back().p999_ms / slices[1].p999_ms;
}

double SoakReport::memory_growth_mb() const {
  return slices.size() < 3 ? kNaN : slices.back().resident_mb - slices.front().resident_mb;
}

Result<SoakReport> soak(const SoakOptions& options, const Function<void(const SoakReport&)>& progress) {
  const double seconds = static_cast<double>(options.updates) / options.camera_rate_hz + 1.0;
  auto world = SimulatedWorld::make(world_options(options, seconds));
  if (!world) return world.error();
  return Soak(options, std::move(*world)).run(progress);
}

}  // namespace oriel
