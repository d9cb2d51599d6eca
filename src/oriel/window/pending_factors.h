// PendingFactors: factors that name times instead of states. A group of them waits until all its states are there or
// can be made, then goes into the graph as it is, in one edit (behaviours W5, W6).
//
//   pending.begin(sensor);
//   pending.add(GnssPosition{...}, Sigma(0.5), Loss::none(), At<Pose3d>{imu, time});
//   pending.add(Reprojection{...}, Sigma(1.0), Huber(2.0), At<Pose3d>{imu, time}, landmark, camera);
//   pending.end();
#pragma once
#include <span>
#include <vector>

#include "oriel/base/byte_column.h"
#include "oriel/graph/graph_edit.h"
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
  VariableKey id;  // its type always; its key where it is static
  bool of_state = false;
  ProviderId provider;
  Time time;

  template <Variable V>
  PendingRef(VariableId<V> v) : id(v) {}  // NOLINT(google-explicit-constructor)
  template <Variable V>
  PendingRef(At<V> at)  // NOLINT(google-explicit-constructor)
      : id(type_key(V::kName), SlotKey{}), of_state(true), provider(at.provider), time(at.time) {}
};

}  // namespace oriel
