// What it costs that a window's solves run beside it: visual-inertial odometry in a simulated world. First the round
// trips of its edits, with a solve that takes no step, so that what is seen is the way there and back; then whole
// updates over those that solve in place, the same frames for all, in blocks that take turns. Values after each frame
// have the same bits, or it is no comparison.
//
//   window_beside [FRAMES [FRAMES_A_SECOND [SPIN_MS]]]     frames come at that rate (0: one right after the other), and
//                                                          cores sleep in between; ExecutorOptions::spin
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>

#include "oriel/base/percentile.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/run/beside_engine.h"
#include "oriel/testing/simulated_world.h"
#include "oriel/window/inertial_odometry.h"

namespace oriel {
namespace {

using Clock = std::chrono::steady_clock;
constexpr int kBlock = 40;  // frames, of each side in its turn

struct Frame {
  Time stamp;
  std::vector<ImuSample> imu;
  std::vector<FeatureObservation> features;
};

// The same window four times: without a task, and with the task in each executor.
struct Side {
  const char* name;
  ExecutorKind kind;
  bool is_task;
  std::unique_ptr<InertialOdometry> odometry;
  std::vector<double> us;         // of each update
  std::vector<Pose3d> estimates;  // after it
};

double share(std::vector<double> us, double p) {
  std::sort(us.begin(), us.end());
  return percentile(us, p);
}

std::vector<Frame> fly(SimulatedWorld& world) {
  std::vector<Frame> frames(1);
  for (SimulatedMeasurement m; world.next(m);) {
    if (m.sensor == SimulatedSensor::imu) frames.back().imu.push_back(m.imu);
    if (m.sensor != SimulatedSensor::camera) continue;
    frames.back().stamp = m.stamp;
    frames.back().features = m.features;
    frames.emplace_back();
  }
  frames.pop_back();
  return frames;
}

void run_block(Side& side, std::span<const Frame> frames, bool counts, Clock::duration period) {
  for (const Frame& frame : frames) {
    const auto due = Clock::now() + period;
    for (const ImuSample& sample : frame.imu) static_cast<void>(side.odometry->add_imu(sample));
    const auto begin = Clock::now();
    const UpdateReport report = side.odometry->update({frame.stamp, frame.features});
    const double us = std::chrono::duration<double, std::micro>(Clock::now() - begin).count();
    if (counts) side.us.push_back(us), side.estimates.push_back(report.values.T_world_body);
    if (period.count() > 0) std::this_thread::sleep_until(due);
  }
}

// What changes in the window's graph from frame to frame, as messages.
std::vector<Bytes> edits_of(const SimulatedWorld& world, const std::vector<Frame>& frames, const OdometryOptions& o) {
  InertialOdometry odometry(world.rig(), true, world.options().imu.noise, o);
  Graph& graph = odometry.window().followed();
  const Subscription subscription = graph.subscribe();
  GraphEdit edit;
  std::vector<Bytes> out;
  for (const Frame& frame : frames) {
    for (const ImuSample& sample : frame.imu) static_cast<void>(odometry.add_imu(sample));
    odometry.update({frame.stamp, frame.features});
    graph.collect(subscription, edit);
    append_edit(out.emplace_back(), edit);
  }
  graph.unsubscribe(subscription);
  return out;
}

// One graph, and what follows it in one executor.
struct Follower {
  Graph graph;
  GraphEdit edit;
  std::unique_ptr<SolveBeside> beside;
  std::vector<double> us;  // of each edit, from submit to the end of write_back
};

bool follow(Follower& f, std::span<const Bytes> edits, const TypeList& types, bool counts) {
  SolveOptions no_step;
  no_step.max_iterations = 0;
  for (const Bytes& bytes : edits) {
    const auto message = read_message(bytes);
    if (!message || !read_edit(*message, types, f.graph, f.edit) || !f.graph.apply(f.edit)) return false;
    const auto begin = Clock::now();
    if (!f.beside->submit(no_step) || f.beside->write_back().status != JobStatus::done) return false;
    if (counts) f.us.push_back(std::chrono::duration<double, std::micro>(Clock::now() - begin).count());
  }
  return true;
}

int compare_round_trips(Zygote& zygote, const std::vector<Bytes>& edits, Duration spin, std::size_t warm_up) {
  std::size_t bytes = 0;
  for (std::size_t k = warm_up; k < edits.size(); ++k) bytes += edits[k].size();
  const TypeList types = shipped_types();
  std::array<Follower, 3> sides;
  constexpr std::array kKinds{ExecutorKind::in_place, ExecutorKind::thread, ExecutorKind::process};
  for (std::size_t i = 0; i < sides.size(); ++i) {
    ExecutorOptions options;
    options.zygote = &zygote;
    options.spin = spin;
    auto beside = SolveBeside::start(sides[i].graph, kKinds[i], options);
    if (!beside) return std::fprintf(stderr, "%s\n", beside.error().text().c_str()), 1;
    sides[i].beside = std::make_unique<SolveBeside>(std::move(*beside));
  }
  for (std::size_t at = 0; at < edits.size(); at += kBlock)
    for (Follower& side : sides)
      if (!follow(side, std::span(edits).subspan(at, std::min<std::size_t>(kBlock, edits.size() - at)), types,
                  at >= warm_up))
        return std::fprintf(stderr, "window_beside: an edit was refused\n"), 1;

  std::printf("round trips of a window's edits, %zu bytes each, one right after the other\n",
              bytes / (edits.size() - warm_up));
  std::printf("%10s %10s %10s %26s\n", "executor", "p50 [us]", "p99 [us]", "over inline, p50 of frames");
  for (std::size_t i = 0; i < sides.size(); ++i) {
    if (fingerprint(sides[i].graph) != fingerprint(sides[0].graph))
      return std::fprintf(stderr, "window_beside: %s came to another graph\n", name_of(kKinds[i]).c_str()), 1;
    std::vector<double> over;
    for (std::size_t k = 0; k < sides[i].us.size(); ++k) over.push_back(sides[i].us[k] - sides[0].us[k]);
    std::printf("%10s %10.0f %10.0f %26.0f\n", name_of(kKinds[i]).c_str(), share(sides[i].us, 0.5),
                share(sides[i].us, 0.99), share(over, 0.5));
  }
  return 0;
}

int compare(Zygote& zygote, int count, double rate, Duration spin) {
  constexpr int kWarmUp = 5 * kBlock;
  SimulatedWorldOptions options;
  options.seconds = 0.05 * (count + kWarmUp + 1);
  options.rests.push_back({0.0, 2.0});
  auto world = SimulatedWorld::make(options);
  if (!world) return std::fprintf(stderr, "%s\n", world.error().text().c_str()), 1;
  const std::vector<Frame> frames = fly(*world);
  std::array<Side, 4> sides{{{"no task", ExecutorKind::in_place, false, {}, {}, {}},
                             {"inline", ExecutorKind::in_place, true, {}, {}, {}},
                             {"thread", ExecutorKind::thread, true, {}, {}, {}},
                             {"process", ExecutorKind::process, true, {}, {}, {}}}};
  OdometryOptions o;
  o.keep_trajectory = false;
  o.keyframes.expected_tracks = options.cameras.tracks;
  if (const int failed = compare_round_trips(zygote, edits_of(*world, frames, o), spin, kWarmUp); failed != 0)
    return failed;
  for (Side& side : sides) {
    side.odometry = std::make_unique<InertialOdometry>(world->rig(), true, options.imu.noise, o);
    ExecutorOptions worker;
    worker.zygote = &zygote;
    worker.spin = spin;
    if (!side.is_task) continue;
    auto engine = BesideEngine::make(side.odometry->window().followed(), side.kind, worker);
    if (!engine) return std::fprintf(stderr, "%s\n", engine.error().text().c_str()), 1;
    if (auto ok = side.odometry->window().use(std::move(*engine)); !ok) return 1;
  }
  const auto period = rate > 0.0 ? std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / rate)) : Clock::duration{};
  for (std::size_t at = 0; at < frames.size(); at += kBlock)
    for (Side& side : sides) {
      const auto n = std::min<std::size_t>(kBlock, frames.size() - at);
      run_block(side, std::span(frames).subspan(at, n), at >= kWarmUp, period);
    }

  std::printf("%zu updates of a window, %s\n", sides[0].us.size(),
              rate > 0.0 ? "at a rate" : "one right after the other");
  std::printf("%10s %10s %10s %30s %26s\n", "executor", "p50 [us]", "p99 [us]", "over no task, p50 of frames",
              "over inline, p50 of frames");
  for (const Side& side : sides) {
    if (std::memcmp(side.estimates.data(), sides[0].estimates.data(), side.estimates.size() * sizeof(Pose3d)) != 0)
      return std::fprintf(stderr, "window_beside: %s came to other estimates\n", side.name), 1;
    std::vector<double> over_none, over_inline;
    for (std::size_t i = 0; i < side.us.size(); ++i) {
      over_none.push_back(side.us[i] - sides[0].us[i]);
      over_inline.push_back(side.us[i] - sides[1].us[i]);
    }
    std::printf("%10s %10.0f %10.0f %30.0f %26.0f\n", side.name, share(side.us, 0.5), share(side.us, 0.99),
                share(over_none, 0.5), share(over_inline, 0.5));
  }
  return 0;
}

}  // namespace
}  // namespace oriel

int main(int argc, char** argv) {
  using namespace oriel;
  auto zygote = Zygote::start({&SolveBeside::kTask});
  if (!zygote) return std::fprintf(stderr, "%s\n", zygote.error().text().c_str()), 1;
  const int frames = argc > 1 ? std::atoi(argv[1]) : 1000;
  const double rate = argc > 2 ? std::atof(argv[2]) : 0.0;
  const double spin_ms = argc > 3 ? std::atof(argv[3]) : 1.0;
  if (argc > 4 || frames < 1 || rate < 0.0 || spin_ms < 0.0) {
    std::fprintf(stderr, "window_beside: expected [FRAMES [FRAMES_A_SECOND [SPIN_MS]]]\n");
    return 2;
  }
  return compare(*zygote, frames, rate, Duration::from_seconds(1e-3 * spin_ms));
}
