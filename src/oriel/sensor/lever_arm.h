// Where a sensor sits on the body: a constant of the graph that all its measurements share.
#pragma once
#include "oriel/manifold/manifold.h"

namespace oriel {

template <class S>
struct LeverArm {
  static constexpr std::string_view kName = "lever_arm/1";
  static constexpr int kDim = 0;
  template <class T>
  using rebind = LeverArm<T>;

  Vec<S, 3> p_body_sensor = Vec<S, 3>::zero();  // [m]
};
using LeverArmd = LeverArm<double>;

// A place in the world that was surveyed: a radio beacon.
template <class S>
struct Beacon {
  static constexpr std::string_view kName = "beacon/1";
  static constexpr int kDim = 0;
  template <class T>
  using rebind = Beacon<T>;

  Vec<S, 3> p_world_beacon = Vec<S, 3>::zero();  // [m]
};
using Beacond = Beacon<double>;

static_assert(Constant<LeverArmd> && Rebindable<LeverArmd> && Constant<Beacond> && Rebindable<Beacond>);

}  // namespace oriel
