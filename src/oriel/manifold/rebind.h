// The type behind a variable over another scalar; a type that exists over one scalar alone is itself.
#pragma once
#include "oriel/manifold/manifold.h"

namespace oriel {

template <class S, class V>
struct OverScalar {
  using type = V;
};
template <class S, class V>
requires requires { typename V::template rebind<S>; }
struct OverScalar<S, V> {
  using type = typename V::template rebind<S>;
};
template <class S, class V>
using over_scalar_t = typename OverScalar<S, V>::type;

}  // namespace oriel
