// The types that come with the library, for whoever reads what another program wrote: journals, replicas, workers.
#pragma once
#include "oriel/graph/type_ops.h"

namespace oriel {

// Every shipped variable, and every shipped residual with the noise shapes that it is used with; Prior of each
// variable, Between of all that have one but VectorN. A program with types of its own adds them to a copy: `TypeList
// types = shipped_types(); types.factor<BeaconRange, IsotropicNoise>();`
TypeList shipped_types();

}  // namespace oriel
