// The shipped insertion hooks and window policies, by name.
#include "oriel/run/window_parts.h"
#include "oriel/window/cheirality_hook.h"
#include "oriel/window/gap_reset_hook.h"
#include "oriel/window/imu_provider.h"
#include "oriel/window/keyframe_policy.h"
#include "oriel/window/mahalanobis_gate.h"
#include "oriel/window/refine_hook.h"
#include "oriel/window/standstill_hook.h"

namespace oriel {
namespace {

using namespace setting;

// ---- hooks ----

struct GatePart {
  std::string builder;
  GateOptions gate;
};

Result<void> make_gate(const GatePart& o, WindowAssembly& window) {
  const auto sensor = window.sensor(o.builder);
  if (!sensor) return sensor.error();
  auto gate = std::make_unique<MahalanobisGate>(window.window().core().followed());
  if (auto ok = gate->set(*sensor, o.gate); !ok) return ok;
  MahalanobisGate* g = gate.get();
  window.count("mahalanobis_gate", [g] { return g->dropped() + g->rejected(); });
  window.add(std::move(gate));
  return {};
}

struct CheiralityPart {};

Result<void> make_cheirality(const CheiralityPart&, WindowAssembly& window) {
  auto hook = std::make_unique<CheiralityHook>();
  window.count("cheirality", [h = hook.get()] { return h->dropped(); });
  window.add(std::move(hook));
  return {};
}

struct StandstillPart {
  std::string states;
  StandstillOptions rest;
};

Result<void> make_standstill(const StandstillPart& o, WindowAssembly& window) {
  const auto id = window.provider(o.states);
  if (!id) return id.error();
  const auto imu = window.provider_as<ImuProvider>(o.states, "an IMU");
  if (!imu) return imu.error();
  window.add(std::make_unique<StandstillHook>(*id, **imu, o.rest, window.tracks().motion));
  return {};
}

struct GapPart {
  std::string states;
  Duration longest{10'000'000'000};
};

Result<void> make_gap_reset(const GapPart& o, WindowAssembly& window) {
  const auto id = window.provider(o.states);
  if (!id) return id.error();
  window.add(std::make_unique<GapResetHook>(*id, o.longest));
  return {};
}

struct RefinePart {
  std::string states;
  RefineOptions refine;
};

Result<void> make_refine(const RefinePart& o, WindowAssembly& window) {
  const auto id = window.provider_of(o.states, kVariableOps<Pose3d>.key, "a pose");
  if (!id) return id.error();
  auto hook = std::make_unique<RefineHook>(*id, o.refine);
  window.count("wrong_match", [h = hook.get()] { return h->dropped(); });
  window.add(std::move(hook));
  return {};
}

WindowPart refine_part() {
  using P = RefinePart;
  return window_part<P>("Finds a new pose among known points where its prediction is far off; wrong matches leave.",
                        {{"states", Reference{Reference::To::provider, member<&P::states>}, "-",
                          "The provider of the poses; empty: the first."},
                         {"least_points", Whole{member<&P::refine, &RefineOptions::least_points>, 4, 100000}, "-",
                          "That a pose is refined from."},
                         {"refine_above", Real{member<&P::refine, &RefineOptions::refine_above>, kTiny, kHuge}, "px",
                          "Median error of a predicted pose above which it is refined."},
                         {"match_gate", Real{member<&P::refine, &RefineOptions::match_gate>, kTiny, kHuge}, "px",
                          "A sighting of a known point that is further off is no match."},
                         {"predict_gate", Real{member<&P::refine, &RefineOptions::predict_gate>, kTiny, kHuge}, "px",
                          "The same, where the points agree with no pose and the prediction has to do."}},
                        make_refine);
}

WindowPart gate_part() {
  using P = GatePart;
  return window_part<P>(
      "A builder's factors against chi-squared.",
      {{"builder", Reference{Reference::To::builder, member<&P::builder>}, "-", "Whose factors; empty: the first's."},
       {"probability", Real{member<&P::gate, &GateOptions::probability>, 1e-6, 1.0 - 1e-9}, "-",
        "With which a measurement of the right model passes."},
       {"with_covariance", Flag{member<&P::gate, &GateOptions::with_covariance>}, "-",
        "The states' covariance counts; else the noise alone."},
       {"rejects_group", Flag{member<&P::gate, &GateOptions::rejects_group>}, "-",
        "All of a group goes if one of its factors fails; else that factor."}},
      make_gate);
}

WindowPart standstill_part() {
  using P = StandstillPart;
  using O = StandstillOptions;
  return window_part<P>(
      "Where IMU, speed and tracks say that nothing moves: zero velocity, and the pose of the state before.",
      {{"states", Reference{Reference::To::provider, member<&P::states>}, "-",
        "The provider, with an IMU; empty: the first."},
       {"span", Seconds{member<&P::rest, &O::span>}, "s", "Of the IMU's samples before the state that must be still."},
       {"gyro", Real{member<&P::rest, &O::gyro>, kTiny, kHuge}, "rad/s", "Their largest distance from their mean."},
       {"accel", Real{member<&P::rest, &O::accel>, kTiny, kHuge}, "m/s2", "Their largest distance from their mean."},
       {"turn", Real{member<&P::rest, &O::turn>, kTiny, kHuge}, "rad/s", "The mean itself, without the bias."},
       {"speed", Real{member<&P::rest, &O::speed>, kTiny, kHuge}, "m/s", "That is believed, at most."},
       {"pixels", Real{member<&P::rest, &O::pixels>, kTiny, kHuge}, "px",
        "By which tracks may move since the state before, in the median."},
       {"velocity_sigma", Real{member<&P::rest, &O::velocity_sigma>, kTiny, kHuge}, "m/s", "Of zero velocity."},
       {"rotation_sigma", Real{member<&P::rest, &O::rotation_sigma>, kTiny, kHuge}, "rad", "Of no rotation."},
       {"translation_sigma", Real{member<&P::rest, &O::translation_sigma>, kTiny, kHuge}, "m", "Of no translation."}},
      make_standstill);
}

// ---- policies ----

struct KeyframePart {
  std::string states;
  KeyframeRules rules;
};

Result<void> make_keyframes(const KeyframePart& o, WindowAssembly& window) {
  const auto id = window.provider(o.states);
  if (!id) return id.error();
  if (auto ok = KeyframePolicy::feasible(o.rules); !ok) return ok;
  window.set(std::make_unique<KeyframePolicy>(*id, window.tracks().overlap, o.rules));
  return {};
}

WindowPart keyframes_part() {
  using P = KeyframePart;
  using R = KeyframeRules;
  return window_part<P>(
      "Keyframes stay, by parallax, shared tracks and time.",
      {{"states", Reference{Reference::To::provider, member<&P::states>}, "-",
        "The provider whose states are keyframes; empty: the first."},
       {"parallax", Real{member<&P::rules, &R::parallax>, kTiny, 3.2}, "rad",
        "Median angle by which tracks moved since the last keyframe that makes a state one."},
       {"least_shared", Real{member<&P::rules, &R::least_shared>, 0.0, 1.0}, "-",
        "Share of a state's tracks that the last keyframe saw, below which it is one."},
       {"interval", Seconds{member<&P::rules, &R::interval>}, "s",
        "Time since the last keyframe after which a state is one."},
       {"max_keyframes", Whole{member<&P::rules, &R::max_keyframes>, 1, 1000}, "-",
        "Keyframes in the window; the oldest is marginalized when there are more."},
       {"others", Word{"drop lag keep", member<&P::rules, &R::others>}, "-",
        "Other states leave when the next comes, when there are `lag` newer ones, or with the keyframe before them."},
       {"lag", Whole{member<&P::rules, &R::lag>, 0, 1000}, "-", "Newer states that another state stays for."}},
      make_keyframes);
}

Result<void> make_lag(const Lag& o, WindowAssembly& window) {
  auto policy = std::make_unique<LagPolicy>();
  if (auto ok = policy->set(o); !ok) return ok;
  window.set(std::move(policy));
  return {};
}

WindowPart lag_part() {
  return window_part<Lag>(
      "The last states stay, or the last seconds.",
      {{"min_states", Whole{member<&Lag::min_states>, 1, 100000}, "-", "That stay at least."},
       {"max_states", Whole{member<&Lag::max_states>, 1, 100000}, "-", "That stay at most."},
       {"duration", Seconds{member<&Lag::duration>, true}, "s", "How long a state stays; 0: as max_states says."}},
      make_lag);
}

}  // namespace

NameTable<WindowPart> shipped_hooks() {
  NameTable<WindowPart> table("hook");
  add_shipped(table, "refine", refine_part());
  add_shipped(table, "mahalanobis_gate", gate_part());
  add_shipped(table, "gap_reset",
              window_part<GapPart>("Two states further apart than that: the window begins anew.",
                                   {{"states", Reference{Reference::To::provider, member<&GapPart::states>}, "-",
                                     "The provider; empty: the first."},
                                    {"longest", Seconds{member<&GapPart::longest>}, "s", "Gap that can be bridged."}},
                                   make_gap_reset));
  add_shipped(table, "cheirality",
              window_part<CheiralityPart>("Takes out sightings of what lies behind the camera.", {}, make_cheirality));
  add_shipped(table, "standstill", standstill_part());
  return table;
}

NameTable<WindowPart> shipped_policies() {
  NameTable<WindowPart> table("policy");
  add_shipped(table, "keyframes", keyframes_part());
  add_shipped(table, "lag", lag_part());
  return table;
}

}  // namespace oriel
