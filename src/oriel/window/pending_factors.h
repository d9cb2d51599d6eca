// PendingFactors: factors that name times instead of states. A group of them waits until all its states are there or
// can be made, then goes into the graph as it is, in one edit (behaviours W5, W6).
//
//   pending.begin();                                    // of the builder that is asked, or begin(sensor)
//   pending.add(GnssPosition{...}, Sigma(0.5), At<Pose3d>{imu, time});
//   VariableId<Point3d> p = pending.add(Point3d{...});  // comes with the group; this id is good within it alone
//   pending.add(Reprojection{...}, Sigma(1.0), Huber(2.0), At<Pose3d>{imu, time}, p, camera);
//   pending.end();
//
// What is stored is bytes in arenas that are reused, so that a steady window's groups allocate nothing.
#pragma once
#include <span>
#include <string>
#include <vector>

#include "oriel/base/byte_column.h"
#include "oriel/graph/graph.h"
#include "oriel/window/states.h"

namespace oriel {

// A variable of a state, by provider and time.
template <Variable V>
struct At {
  ProviderId provider;
  Time time;
};

// A variable as a pending factor names it.
struct PendingRef {
  VariableKey id;  // its type always; its key where it is static, a placeholder where it comes with the group
  bool of_state = false;
  ProviderId provider;
  Time time;

  template <Variable V>
  PendingRef(VariableId<V> v) : id(v) {}  // NOLINT(google-explicit-constructor)
  template <Variable V>
  PendingRef(At<V> at)  // NOLINT(google-explicit-constructor)
      : id(type_key(V::kName), SlotKey{}), of_state(true), provider(at.provider), time(at.time) {}
};

namespace detail {
template <class A>
struct PendingVariable;
template <class V>
struct PendingVariable<VariableId<V>> {
  using type = V;
};
template <class V>
struct PendingVariable<At<V>> {
  using type = V;
};
}  // namespace detail
// VariableId<V> or At<V>.
template <class A>
concept PendingArgument = requires {
  typename detail::PendingVariable<A>::type;
};

// What stands in the way of a group.
enum class Readiness {
  ready,
  waits,          // a state cannot be had yet
  too_old,        // a state cannot be had any more
  unknown_id,     // a static variable is not in the graph (any more)
  unknown_state,  // no such provider, or its states have no variable of that type
};

class PendingFactors {
 public:
  struct Group {
    int sensor = 0;
    int owner = -1;            // the builder that it is of, by its place in the window
    std::uint64_t number = 0;  // from 1, in the order of coming
    bool has_states = false;
    Time oldest, newest;  // of the times that it names
    std::uint32_t first_factor = 0, factors = 0, first_variable = 0, variables = 0, first_ref = 0, refs = 0;
    std::size_t first_byte = 0, bytes = 0;
    bool live = true;
  };
  struct Factor {
    FactorId (*add)(GraphEdit&, const void* measurement, const void* noise, const Loss&,
                    const SlotKey* variables) = nullptr;
    const FactorOps* ops = nullptr;
    Loss loss;
    std::size_t measurement = 0, noise = 0;  // in the arena of bytes
    std::uint32_t first_ref = 0;             // as many as ops has variables
  };

  // The number of a sensor by its name, given at the first call.
  int sensor(std::string_view name);
  int sensors() const { return static_cast<int>(sensors_.size()); }
  const std::string& sensor_name(int sensor) const { return sensors_[sensor]; }
  // Whom begin() without a sensor means, and whose groups come now.
  void set_sensor(int sensor, int owner = -1) { sensor_ = sensor, owner_ = owner; }

  // ---- what builders do ----
  // The group's number. Groups do not nest.
  std::uint64_t begin() { return begin(sensor_); }
  std::uint64_t begin(int sensor);
  // A variable that enters the graph with the group. Its id is a placeholder, good within the group.
  template <Variable V>
  VariableId<V> add(const V& value);
  template <Residual R, class Noise, PendingArgument... A>
  void add(const R& residual, const Noise& noise, const A&... variables) {
    add(residual, noise, Loss::none(), variables...);
  }
  template <Residual R, class Noise, PendingArgument... A>
  void add(const R& residual, const Noise& noise, const Loss& loss, const A&... variables);
  // The group makes that state, whether or not a factor names it: a frame in which everything is new.
  template <Variable V>
  void need(const At<V>& state) {
    add_ref(state);
  }
  void end();

  // ---- what the window does ----
  const std::vector<Group>& groups() const { return groups_; }
  std::span<const Factor> factors(const Group& g) const { return {factors_.data() + g.first_factor, g.factors}; }
  std::span<const PendingRef> refs(const Factor& f) const {
    return {refs_.data() + f.first_ref, f.ops->variables.size()};
  }
  std::span<const PendingRef> refs(const Group& g) const { return {refs_.data() + g.first_ref, g.refs}; }
  const void* measurement(const Factor& f) const { return bytes_.data() + f.measurement; }
  const void* noise(const Factor& f) const { return bytes_.data() + f.noise; }
  Readiness readiness(const Group& group, const Graph& graph, const States& states) const;
  // Puts the group's variables and factors into the edit; the states that it names are there. Their ids are appended.
  void insert(const Group& group, const States& states, GraphEdit& edit, std::vector<VariableKey>& variables,
              std::vector<FactorId>& factors);
  // The group is done with, entered or refused.
  void drop(std::size_t place) { groups_[place].live = false; }
  // Closes the holes; places of groups change.
  void compact();
  void clear();
  std::size_t size() const;  // live groups

 private:
  struct NewVariable {
    VariableKey (*add)(GraphEdit&, const void* value) = nullptr;
    std::size_t value = 0;  // in the arena of bytes
  };
  std::size_t store(const void* data, std::size_t bytes);
  VariableKey add_variable(VariableKey (*adder)(GraphEdit&, const void*), std::uint64_t type, const void* value,
                           std::size_t bytes);
  void add_ref(const PendingRef& ref);
  void add_factor(const Factor& factor, const void* measurement, const void* noise, std::span<const PendingRef> refs);
  Readiness readiness(const Group& group, const PendingRef& ref, const Graph& graph, const States& states) const;

  std::vector<std::string> sensors_;
  int sensor_ = 0, owner_ = -1;
  bool open_ = false;
  std::uint64_t number_ = 0;
  std::vector<Group> groups_;
  std::vector<Factor> factors_;
  std::vector<NewVariable> variables_;
  std::vector<PendingRef> refs_;
  std::vector<std::byte> bytes_;      // every value at 16 bytes' alignment
  std::vector<VariableKey> entered_;  // scratch of insert
};

// ---- implementation of the templates ----

template <Variable V>
VariableId<V> PendingFactors::add(const V& value) {
  static_assert(alignof(V) <= 16, "values are stored at 16 bytes' alignment");
  const auto adder = [](GraphEdit& edit, const void* stored) -> VariableKey {
    return edit.add(*static_cast<const V*>(stored));
  };
  return {add_variable(adder, kVariableOps<V>.key, &value, sizeof(V)).key};
}

template <Residual R, class Noise, PendingArgument... A>
void PendingFactors::add(const R& residual, const Noise& noise, const Loss& loss, const A&... variables) {
  static_assert(ResidualTraits<R>::kArity == sizeof...(A), "as many variables as the residual's Variables are needed");
  static_assert(detail::kSameVariables<typename R::Variables, typename detail::PendingVariable<A>::type...>,
                "the variables must be those of the residual's Variables, each as VariableId<V> or At<V>");
  static_assert(detail::kNoiseFits<Noise, ResidualTraits<R>::kDim>,
                "the noise has another dimension than the residual");
  static_assert(alignof(R) <= 16 && alignof(Noise) <= 16, "measurements are stored at 16 bytes' alignment");
  Factor factor;
  factor.add = [](GraphEdit& edit, const void* measurement, const void* whitener, const Loss& of,
                  const SlotKey* keys) -> FactorId {
    return [&]<std::size_t... I>(std::index_sequence<I...>) {
      return edit.add(*static_cast<const R*>(measurement), *static_cast<const Noise*>(whitener), of,
                      VariableId<typename detail::PendingVariable<A>::type>{keys[I]}...);
    }
    (std::index_sequence_for<A...>{});
  };
  factor.ops = &kFactorOps<R, Noise>;
  factor.loss = loss;
  const PendingRef refs[] = {variables...};
  add_factor(factor, &residual, &noise, refs);
}

}  // namespace oriel
