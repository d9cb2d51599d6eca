// SensorBuilder: stamped measurements of any residual → pending factors, one group each. For GNSS, ranges, wheel speed,
// magnetometers, absolute poses: whatever is measured at one time.
//
//   auto gnss = std::make_unique<SensorBuilder<GnssPosition, IsotropicNoise>>("gnss", imu, Huber(2.0));
//   gnss->add(time, GnssPosition{p_world}, Sigma(0.5));
//
// Variables of the residual that are no state's (a beacon, a lever arm) come last in its Variables, and their ids with
// each measurement: SensorBuilder<BeaconRange, IsotropicNoise, 1> has one variable of the state, the others are given.
#pragma once
#include <array>
#include <string>
#include <tuple>
#include <vector>

#include "oriel/window/factor_builder.h"

namespace oriel {

template <Residual R, class Noise, int kOfState = ResidualTraits<R>::kArity>
class SensorBuilder final : public FactorBuilder {
  static constexpr int kArity = ResidualTraits<R>::kArity, kStatic = kArity - kOfState;
  static_assert(kOfState >= 1 && kStatic >= 0);

 public:
  SensorBuilder(std::string name, ProviderId provider, const Loss& loss = Loss::none())
      : name_(std::move(name)), provider_(provider), loss_(loss) {}

  // In any order of time. A number that is not finite is refused when the group enters, and counted there.
  template <class... V>
  void add(Time time, const R& measured, const Noise& noise, VariableId<V>... others) {
    static_assert(sizeof...(V) == kStatic, "ids of the residual's last variables, those that are not of the state");
    measured_.push_back({time, measured, noise, {others.key...}});
  }

  std::string_view name() const override { return name_; }
  void drain(const Graph&, const States&, PendingFactors& pending) override {
    for (const Measured& m : measured_) {
      pending.begin();
      add(pending, m, std::make_index_sequence<kOfState>{}, std::make_index_sequence<kStatic>{});
      pending.end();
    }
    measured_.clear();
  }

 private:
  struct Measured {
    Time time;
    R value;
    Noise noise;
    std::array<SlotKey, kStatic> others;
  };
  template <int I>
  using Var = typename ResidualTraits<R>::template Var<I>;

  template <std::size_t... S, std::size_t... O>
  void add(PendingFactors& pending, const Measured& m, std::index_sequence<S...>, std::index_sequence<O...>) {
    pending.add(m.value, m.noise, loss_, At<Var<S>>{provider_, m.time}...,
                VariableId<Var<kOfState + O>>{m.others[O]}...);
  }

  std::string name_;
  ProviderId provider_;
  Loss loss_;
  std::vector<Measured> measured_;
};

}  // namespace oriel
