// A cart on a rail, for the tests that show how a window is extended: its wheel says how far it went.
#pragma once
#include <array>
#include <map>

#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/window/sliding_window.h"

namespace oriel::rail {

using Along = VectorNd<1>;  // [m] from the rail's end

constexpr Time at_s(std::int64_t s) { return {s * 1000000000}; }

// States are where the cart is; what moves it is how far the wheel turned, even between two readings.
class WheelStates final : public StateProvider {
 public:
  // The wheel's reading [m] at a time.
  void add(Time time, double reading) { readings_[time] = reading; }

  std::string_view name() const override { return "wheel"; }
  std::span<const VariableOps* const> variables() const override { return kVariables; }
  Result<void> begin(GraphEdit& edit, State& state) override {
    keep(state, edit.add(Along{}));
    edit.add(Prior{Along{}}, Sigma(10.0), id(state));
    return {};
  }
  bool covers(Time from, Time to) const override {
    return !readings_.empty() && readings_.begin()->first <= from && to <= readings_.rbegin()->first;
  }
  Result<void> predict(GraphEdit& edit, const State& from, State& state) override {
    keep(state, edit.add(edit.value(id(from)).plus(moved(from.time, state.time))));
    return {};
  }
  Result<FactorId> link(GraphEdit& edit, const State& from, const State& to) override {
    const double sigma = 0.02 * std::sqrt((to.time - from.time).seconds());  // a random walk: halves add up
    return edit.add(Between{Along{moved(from.time, to.time)}}, Sigma(sigma), id(from), id(to));
  }
  void forget_before(Time time) override {
    while (readings_.size() > 1 && std::next(readings_.begin())->first <= time) readings_.erase(readings_.begin());
  }
  std::size_t readings() const { return readings_.size(); }

  static VariableId<Along> id(const State& state) { return {state.variables[0].key}; }

 private:
  static void keep(State& state, VariableId<Along> x) {
    state.count = 1;
    state.variables[0] = x;
  }
  Vec1d moved(Time from, Time to) const { return {{reading(to) - reading(from)}}; }
  double reading(Time time) const {
    const auto after = readings_.lower_bound(time);
    if (after->first == time) return after->second;
    const auto before = std::prev(after);
    const double part = (time - before->first).seconds() / (after->first - before->first).seconds();
    return before->second + part * (after->second - before->second);
  }
  static constexpr std::array<const VariableOps*, 1> kVariables = {&kVariableOps<Along>};
  std::map<Time, double> readings_;
};

// A window with that provider, and readings of a cart that goes one metre a second.
struct Rail {
  SlidingWindow window;
  ProviderId wheel;
  WheelStates* states = nullptr;

  Rail() {
    auto provider = std::make_unique<WheelStates>();
    states = provider.get();
    wheel = window.add(std::move(provider));
    for (int s = 0; s <= 100; ++s) states->add(at_s(s), s);
  }
  // A mark that stands at a place [m] was passed.
  void pass(double place, Time time) {
    PendingFactors& pending = window.pending();
    pending.begin(pending.sensor("marks"));
    pending.add(Prior{Along{{{place}}}}, Sigma(0.1), At<Along>{wheel, time});
    pending.end();
  }
  double where(Time time) const {
    return window.graph().value(WheelStates::id(*window.states().timeline(wheel).find(time))).v[0];
  }
};

}  // namespace oriel::rail
