// How residuals come into the list of shipped types (registry.h), in two files: each type is compiled with each noise.
#pragma once
#include "oriel/graph/type_ops.h"
#include "oriel/residual/noise.h"

namespace oriel::run_detail {

// A residual with every noise shape.
template <class R>
void add(TypeList& types) {
  types.factor<R, IsotropicNoise>();
  types.factor<R, DiagonalNoise<ResidualTraits<R>::kDim>>();
  types.factor<R, FullNoise<ResidualTraits<R>::kDim>>();
}
template <class... R>
void add_each(TypeList& types) {
  (add<R>(types), ...);
}
template <class... R>
void add_isotropic(TypeList& types) {
  (types.factor<R, IsotropicNoise>(), ...);
}

// Priors and relative values of every variable.
void add_priors(TypeList& types);

}  // namespace oriel::run_detail
