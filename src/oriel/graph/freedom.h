// Which directions of a variable's tangent space a solver may take: partial freedom, as data. The manifold that a
// variable lives on at run time is its type's, less the directions that are held.
//
//   edit.set(first, Freedom::hold({2, 3, 4, 5}, Freedom::Axes::world));  // heading and position of the first pose
//   edit.set(first, Freedom::full());                                     // free again
//
// A step d of the variable is restricted to P d = d with P = Bᵀ M B: B takes tangent vectors to the axes in which
// directions are named (d_world = B d; the identity for body axes), M = diag(1 where free, 0 where held). B is taken
// anew at each point that a step leaves from.
//
// What is held is a direction of every step. Where the free directions are closed under composition (those of each
// maker below), the held coordinates of the value stay what they are, whatever the steps. Where they are not (heading
// held, roll and pitch free: two tilts make a turn), they stay to second order in each step.
#pragma once
#include <cstdint>
#include <initializer_list>

namespace oriel {

struct Freedom {
  // body: the components of the tangent as the type names them. world: the same turned into the axes of the world, for
  // types that have world_axes() (manifold.h).
  enum class Axes : std::uint8_t { body, world };

  std::uint32_t held = 0;  // bit k: component k; the first 32 of a tangent can be held
  Axes axes = Axes::body;

  static constexpr Freedom full() { return {}; }
  static constexpr Freedom hold(std::initializer_list<int> components, Axes in = Axes::body) {
    Freedom f;
    for (const int k : components) f.held |= k >= 0 && k < 32 ? std::uint32_t{1} << k : 0;
    f.axes = in;
    return f;
  }
  // Of a pose in space, tangent [rotation; translation]: what is left free.
  static constexpr Freedom position() { return hold({0, 1, 2}); }
  static constexpr Freedom rotation() { return hold({3, 4, 5}); }
  static constexpr Freedom yaw() { return hold({0, 1, 3, 4, 5}, Axes::world); }
  static constexpr Freedom yaw_and_position() { return hold({0, 1}, Axes::world); }
  static constexpr Freedom planar() { return hold({0, 1, 5}, Axes::world); }  // yaw, and x and y of the world

  constexpr bool is_full() const { return held == 0; }
  constexpr bool holds(int component) const { return component < 32 && (held >> component & 1u) != 0; }
  // Where nothing is held there are no axes to differ in.
  friend constexpr bool operator==(const Freedom& a, const Freedom& b) {
    return a.held == b.held && (a.held == 0 || a.axes == b.axes);
  }
};

}  // namespace oriel
