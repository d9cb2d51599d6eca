// What the graph must know of a user's types, as tables of functions: pools, tables, edits and journals are written
// once over these, and a user's translation unit instantiates nothing but them.
#pragma once
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

#include "oriel/manifold/bal_camera.h"
#include "oriel/manifold/inverse_depth.h"
#include "oriel/manifold/manifold.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/linear_prior.h"
#include "oriel/residual/linearize_rows.h"

namespace oriel {

struct VariableOps {
  std::string_view name;
  std::uint64_t key = 0;
  int dim = 0;              // of the tangent space; 0: a constant
  std::uint32_t bytes = 0;  // of a value
  bool landmark = false;
  std::span<const std::string_view> tangent_names;
  // to[i] = from[i] ⊞ step[offset[i]...]; values of negative offset are copied.
  void (*plus)(std::size_t n, const void* from, const double* step, const std::int32_t* offset, void* to) = nullptr;
  void (*minus)(const void* y, const void* x, double* d) = nullptr;  // y ⊟ x
  bool (*finite)(const void* x) = nullptr;
  // B with d_world = B d at x, dim × dim column-major; null: a type without world axes.
  void (*world_axes)(const void* x, double* B) = nullptr;
};

struct FactorOps {
  std::string_view residual;  // name
  std::string_view noise;     // name of the noise shape
  std::uint64_t key = 0;
  int dim = 0;
  std::span<const VariableOps* const> variables;
  std::uint32_t measurement_bytes = 0, noise_bytes = 0;
  bool packed = false;  // whether its rows are evaluated eight at a time: both then are doubles alone
  void (*linearize)(const RowPointers&, Batch&) noexcept = nullptr;
  bool (*finite)(const void* measurement) = nullptr;
  bool (*noise_valid)(const void* noise) = nullptr;
};

namespace detail {

template <Variable V>
bool value_finite(const void* p) {
  if constexpr (Rebindable<V>) {
    return all_finite(static_cast<const double*>(p), sizeof(V) / sizeof(double));
  } else if constexpr (V::kDim > 0) {
    const V& x = *static_cast<const V*>(p);
    return all_finite(x.minus(x));
  } else {
    return all_finite(*static_cast<const V*>(p));
  }
}
template <Variable V>
void plus_all(std::size_t n, const void* from, const double* step, const std::int32_t* offset, void* to) {
  const V* x = static_cast<const V*>(from);
  V* y = static_cast<V*>(to);
  for (std::size_t i = 0; i < n; ++i) {
    if constexpr (V::kDim > 0) {
      if (offset[i] >= 0) {
        Vec<double, V::kDim> d;
        std::memcpy(d.m, step + offset[i], sizeof(d.m));
        y[i] = x[i].plus(d);
        continue;
      }
    }
    y[i] = x[i];
  }
}
template <Variable V>
void minus_one(const void* y, const void* x, double* d) {
  if constexpr (V::kDim > 0) {
    const auto v = static_cast<const V*>(y)->minus(*static_cast<const V*>(x));
    std::memcpy(d, v.m, sizeof(v.m));
  }
}
template <Variable V>
void world_axes_of(const void* x, double* B) {
  const auto axes = static_cast<const V*>(x)->world_axes();
  std::memcpy(B, axes.m, sizeof(axes.m));
}
template <Variable V>
constexpr auto world_axes() -> void (*)(const void*, double*) {
  if constexpr (HasWorldAxes<V>)
    return &world_axes_of<V>;
  else
    return nullptr;
}
template <Variable V>
constexpr std::span<const std::string_view> tangent_names() {
  if constexpr (requires { V::kTangentNames.size(); })
    return V::kTangentNames;
  else
    return {};
}

template <class Vars>
struct OpsOf;

}  // namespace detail

// Those of shipped types are compiled once, in the library, with its instruction set.
extern template void detail::plus_all<Rot2d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
extern template void detail::plus_all<Pose2d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
extern template void detail::plus_all<Rot3d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
extern template void detail::plus_all<Pose3d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
extern template void detail::plus_all<Point2d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
extern template void detail::plus_all<Point3d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
extern template void detail::plus_all<Velocity3d>(std::size_t, const void*, const double*, const std::int32_t*, void*);
extern template void detail::plus_all<ImuBiasd>(std::size_t, const void*, const double*, const std::int32_t*, void*);
extern template void detail::plus_all<InverseDepthd>(std::size_t, const void*, const double*, const std::int32_t*,
                                                     void*);
extern template void detail::plus_all<BalCamerad>(std::size_t, const void*, const double*, const std::int32_t*, void*);
extern template void detail::minus_one<Rot2d>(const void*, const void*, double*);
extern template void detail::minus_one<Pose2d>(const void*, const void*, double*);
extern template void detail::minus_one<Rot3d>(const void*, const void*, double*);
extern template void detail::minus_one<Pose3d>(const void*, const void*, double*);
extern template void detail::minus_one<Point2d>(const void*, const void*, double*);
extern template void detail::minus_one<Point3d>(const void*, const void*, double*);
extern template void detail::minus_one<Velocity3d>(const void*, const void*, double*);
extern template void detail::minus_one<ImuBiasd>(const void*, const void*, double*);
extern template void detail::minus_one<InverseDepthd>(const void*, const void*, double*);
extern template void detail::minus_one<BalCamerad>(const void*, const void*, double*);
extern template void detail::world_axes_of<Pose2d>(const void*, double*);
extern template void detail::world_axes_of<Rot3d>(const void*, double*);
extern template void detail::world_axes_of<Pose3d>(const void*, double*);

template <Variable V>
inline constexpr VariableOps kVariableOps = {V::kName,
                                             type_key(V::kName),
                                             V::kDim,
                                             sizeof(V),
                                             Landmark<V>&& V::kDim <= 3,  // elimination has kernels up to 3
                                             detail::tangent_names<V>(),
                                             &detail::plus_all<V>,
                                             &detail::minus_one<V>,
                                             &detail::value_finite<V>,
                                             detail::world_axes<V>()};

namespace detail {
template <class... V>
struct OpsOf<Types<V...>> {
  static_assert((Variable<V> && ...), "every type in Variables must be a Manifold or a Constant (manifold.h)");
  static_assert(((alignof(V) <= 16) && ...), "values are stored at 16 bytes' alignment");
  static constexpr std::array<const VariableOps*, sizeof...(V)> kOps = {&kVariableOps<V>...};
};
}  // namespace detail

template <Residual R, class Noise>
inline constexpr FactorOps kFactorOps = {R::kName,
                                         Noise::kName,
                                         type_key(R::kName) * 31 + type_key(Noise::kName),
                                         ResidualTraits<R>::kDim,
                                         detail::OpsOf<typename R::Variables>::kOps,
                                         sizeof(R),
                                         sizeof(Noise),
                                         kEvaluatedInPacks<R>,
                                         &linearize_rows<R, Noise>,
                                         [](const void* m) { return all_finite(*static_cast<const R*>(m)); },
                                         [](const void* n) { return static_cast<const Noise*>(n)->valid(); }};

// The types that a reader (journal, worker, Python) may meet: variables, factors, losses of users. An edit names them.
class TypeList {
 public:
  template <Variable V>
  TypeList& variable() {
    return add(&kVariableOps<V>);
  }
  template <Residual R, class Noise>
  TypeList& factor() {
    for (const VariableOps* v : kFactorOps<R, Noise>.variables) add(v);
    factors_.push_back(&kFactorOps<R, Noise>);
    return *this;
  }
  template <LossFunction L>
  TypeList& loss() {
    losses_.push_back(&kLossOps<L>);
    return *this;
  }
  TypeList& add(const VariableOps* v) {
    if (find_variable(v->key) == nullptr) variables_.push_back(v);
    return *this;
  }
  const VariableOps* find_variable(std::uint64_t key) const {
    for (const VariableOps* v : variables_)
      if (v->key == key) return v;
    return nullptr;
  }
  const LossOps* find_loss(std::string_view name) const {
    for (const LossOps* l : losses_)
      if (l->name == name) return l;
    return nullptr;
  }
  const FactorOps* find_factor(std::uint64_t key) const {
    for (const FactorOps* f : factors_)
      if (f->key == key) return f;
    return nullptr;
  }

 private:
  std::vector<const VariableOps*> variables_;
  std::vector<const FactorOps*> factors_;
  std::vector<const LossOps*> losses_;
};

}  // namespace oriel
