// The parts that a sliding window is put together from, by name: who makes states (providers), who makes factors
// (builders), who looks at what enters (hooks) and who says what leaves (policies). A part is a sentence, its settings
// and a function that makes it and adds it to a window. The tables are values; one's own part is added to a copy:
//
//   WindowParts parts = shipped_parts();
//   parts.builders.add("deck", window_part<DeckOptions>("The deck's height.", kSettings,
//                      [](const DeckOptions& o, WindowAssembly& window) -> Result<void> {
//                        const auto body = window.provider(o.states);
//                        if (!body) return body.error();
//                        auto deck = std::make_unique<DeckBuilder>(*body, o);
//                        window.on_frame([d = deck.get()](const StereoFrame& f) { d->add(f.time); });
//                        window.add(std::move(deck));
//                        return {};
//                      }));
#pragma once
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "oriel/base/function.h"
#include "oriel/run/name_table.h"
#include "oriel/run/setting.h"
#include "oriel/sensor/imu.h"
#include "oriel/sensor/preintegration.h"
#include "oriel/window/initialise.h"
#include "oriel/window/keyframe_policy.h"
#include "oriel/window/sliding_window.h"

namespace oriel {

// What sensors there are: known before the first measurement.
struct SensorSuite {
  bool has_imu = false, has_odometry = false, has_positions = false;
  ImuNoise imu{};   // of the data sheet
  int cameras = 0;  // 2: the first sees every track
  StereoRigd rig{};
};

// The motion since the stamp before, in the frame there, and how well it is known; and a position of the body.
struct MeasuredMotion {
  Time time;
  Pose3d motion;
  Mat6d covariance;
};
struct MeasuredPosition {
  Time time;
  Vec3d p_world;  // [m]
  double sigma;   // of a coordinate [m]
};

// When a window begins, and how: asked with each frame until it says yes.
class WindowStart {
 public:
  virtual ~WindowStart() = default;
  // True: whoever makes states knows the first one; the frames that it holds go in, one after the other.
  virtual bool add(const StereoFrame& frame) = 0;
  virtual const char* reason() const = 0;  // why not yet
  virtual std::size_t frames() const = 0;
  virtual StereoFrame frame(std::size_t k) const = 0;
};

// Who sees tracks: what a policy or a hook may ask of it.
struct TrackWatch {
  KeyframePolicy::Overlap overlap;
  Function<double(Time, Time)> motion;  // median [px]; negative where nothing is shared
};

// A window while it is put together: what makers of parts see of it.
class WindowAssembly {
 public:
  WindowAssembly(SlidingWindow& window, const SensorSuite& sensors, const InitialisationOptions& initialisation)
      : window_(window), sensors_(sensors), initialisation_(initialisation) {}

  SlidingWindow& window() { return window_; }
  const SensorSuite& sensors() const { return sensors_; }
  const InitialisationOptions& initialisation() const { return initialisation_; }

  // ---- parts, under the name that the config has for them ----
  ProviderId add(std::unique_ptr<StateProvider> provider);
  int add(std::unique_ptr<FactorBuilder> builder);
  int add(std::unique_ptr<BatchFactorBuilder> builder);
  void add(std::unique_ptr<InsertionHook> hook) { window_.add(std::move(hook)); }
  void set(std::unique_ptr<WindowPolicy> policy) { window_.set(std::move(policy)); }

  // ---- what there is already; an empty name: the first ----
  Result<ProviderId> provider(std::string_view name) const;
  // Whose states have a variable of that type: "a pose".
  Result<ProviderId> provider_of(std::string_view name, std::uint64_t type, const char* what) const;
  template <class P>
  Result<P*> provider_as(std::string_view name, const char* what) {
    const auto id = provider(name);
    if (!id) return id.error();
    if (P* p = dynamic_cast<P*>(&window_.provider(*id))) return p;
    return Error{ErrorCode::bad_input, std::string("expected ") + what + " as provider"};
  }
  Result<int> sensor(std::string_view builder) const;  // its number, of its groups
  Result<VariableId<StereoRigd>> rig();                // a constant of the graph; made once

  // ---- measurements: who takes them ----
  void on_imu(Function<Result<void>(const ImuSample&)> take) { imu_.push_back(std::move(take)); }
  void on_frame(Function<void(const StereoFrame&)> take) { frames_.push_back(std::move(take)); }
  void on_motion(Function<Result<void>(const MeasuredMotion&)> take) { motions_.push_back(std::move(take)); }
  void on_position(Function<void(const MeasuredPosition&)> take) { positions_.push_back(std::move(take)); }
  // One is enough: the first stays.
  void start_by(std::unique_ptr<WindowStart> start) {
    if (start_ == nullptr) start_ = std::move(start);
  }
  void see_tracks(TrackWatch view) {
    if (!tracks_.overlap) tracks_ = std::move(view);
  }
  const TrackWatch& tracks() const { return tracks_; }  // empty functions: nobody sees any
  // What a report shows, by name: sightings that were dropped, and why.
  void count(std::string name, Function<std::int64_t()> of) { counts_.emplace_back(std::move(name), std::move(of)); }

 private:
  friend class AssembledWindow;

  SlidingWindow& window_;
  const SensorSuite& sensors_;
  InitialisationOptions initialisation_;
  std::string name_;  // of the part that is being made
  std::vector<std::pair<std::string, ProviderId>> providers_;
  std::vector<std::pair<std::string, int>> sensors_of_;
  VariableId<StereoRigd> rig_;
  bool has_rig_ = false;
  std::vector<Function<Result<void>(const ImuSample&)>> imu_;
  std::vector<Function<void(const StereoFrame&)>> frames_;
  std::vector<Function<Result<void>(const MeasuredMotion&)>> motions_;
  std::vector<Function<void(const MeasuredPosition&)>> positions_;
  std::unique_ptr<WindowStart> start_;
  TrackWatch tracks_;
  std::vector<std::pair<std::string, Function<std::int64_t()>>> counts_;
};

struct WindowPart {
  const char* sentence;
  std::vector<Setting> settings;
  AnyOptions defaults;
  // Makes the part and adds it. An error: what it needs and is not there.
  Function<Result<void>(const AnyOptions&, WindowAssembly&)> make;
};
template <class O, class F>
WindowPart window_part(const char* sentence, std::vector<Setting> settings, F make, O defaults = {}) {
  return {sentence, std::move(settings), AnyOptions(std::move(defaults)),
          [make](const AnyOptions& options, WindowAssembly& window) -> Result<void> {
            return make(options.as<O>(), window);
          }};
}

NameTable<WindowPart> shipped_providers();
NameTable<WindowPart> shipped_builders();
NameTable<WindowPart> shipped_hooks();
NameTable<WindowPart> shipped_policies();

struct WindowParts {
  NameTable<WindowPart> providers = shipped_providers();
  NameTable<WindowPart> builders = shipped_builders();
  NameTable<WindowPart> hooks = shipped_hooks();
  NameTable<WindowPart> policies = shipped_policies();
};
inline WindowParts shipped_parts() { return {}; }

}  // namespace oriel
