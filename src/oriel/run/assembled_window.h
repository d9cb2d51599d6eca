// A sliding window put together by names: what a config says (WindowPlan), out of the parts that there are
// (window_parts.h), for the sensors that there are. Measurements go in, updates come out.
//
//   auto window = AssembledWindow::make(plan, parts, sensors).value();
//   for (;;) { window->add(imu_sample); ...; window->update(frame); }
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "oriel/run/window_parts.h"

namespace oriel {

// A part by name, with its settings.
struct PartChoice {
  std::string name;
  AnyOptions options;
  std::string file = {};  // of the config, for errors
  std::int64_t line = 0;
};

struct WindowPlan {
  WindowPlan() {
    window.solve.max_iterations = 12;
    window.solve.function_tolerance = 1e-4;
  }
  WindowOptions window;
  InitialisationOptions initialisation;  // of providers that find their start by themselves
  // Made in this order: providers, builders, hooks, policy.
  std::vector<PartChoice> providers, builders, hooks;
  PartChoice policy;
};
// Visual-inertial odometry: imu; tracks; refine, cheirality and standstill; keyframes.
WindowPlan default_plan(const WindowParts& parts);

class AssembledWindow {
 public:
  // `sensors` is copied. Errors of parts that need what is not there, with the line of the part.
  static Result<std::unique_ptr<AssembledWindow>> make(const WindowPlan& plan, const WindowParts& parts,
                                                       const SensorSuite& sensors);
  AssembledWindow(const AssembledWindow&) = delete;
  AssembledWindow& operator=(const AssembledWindow&) = delete;

  // To whoever takes it. The error is that of the last one who refused it.
  Result<void> add(const ImuSample& sample);
  Result<void> add(const MeasuredMotion& motion);
  void add(const MeasuredPosition& position);
  // A frame, and an update; or several, of all frames that a start has held, when it succeeds. Null: it has not begun
  // yet, and waiting_for() says why.
  const WindowUpdate* update(const StereoFrame& frame);
  // An update without a frame.
  const WindowUpdate& update() { return window_.update(); }
  const char* waiting_for() const;
  bool has_begun() const { return begun_; }

  SlidingWindow& window() { return window_; }
  // Of the first provider, whose poses a report is about.
  ProviderId body() const { return {0}; }
  // What parts count, by name.
  std::vector<std::pair<std::string, std::int64_t>> counts() const;

 private:
  AssembledWindow(const WindowPlan& plan, const SensorSuite& sensors);
  Result<void> make(const PartChoice& choice, const NameTable<WindowPart>& table);
  const WindowUpdate& give(const StereoFrame& frame);

  SensorSuite sensors_;
  SlidingWindow window_;
  WindowAssembly assembly_;
  bool begun_ = false;
};

}  // namespace oriel
