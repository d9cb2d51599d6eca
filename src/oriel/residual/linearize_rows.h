// From typed rows to a Batch: the one place where a residual's type meets the solver. Everything after it knows
// dimensions alone. A row is evaluated eight at a time where its residual can (S = Pack), else one by one.
#pragma once
#include <bit>
#include <cstring>
#include <utility>
#if defined(__AVX512F__)
#include <immintrin.h>
#endif

#include "oriel/base/finite.h"
#include "oriel/residual/batch.h"
#include "oriel/residual/differentiate.h"
#include "oriel/residual/loss.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/residual.h"

namespace oriel {

// Where up to 64 rows find what they need. Argument k of row l: at[k * Batch::kRows + l].
struct RowPointers {
  int rows = 0;
  std::uint64_t active = ~std::uint64_t{0};  // lanes that count; the others only fill up a group of eight
  const void* const* measurement = nullptr;
  const void* const* noise = nullptr;
  const Loss* const* loss = nullptr;  // null: no row has one
  const void* const* at = nullptr;    // the values, for r
  // Where Jacobians are taken: the same as `at`, or first estimates for the variables that have one (decision 9).
  const void* const* jacobian_at = nullptr;
};

namespace detail {

constexpr int kGroup = Pack::kLanes;

// T<double> behind eight pointers → T<Pack>, whose members all are packs and stand in the same order.
template <Rebindable T>
void gather(const void* const* rows, typename T::template rebind<Pack>& out) {
  constexpr int n = sizeof(T) / sizeof(double);
  static_assert(sizeof(out) == n * sizeof(Pack));
  Pack* s = reinterpret_cast<Pack*>(&out);
#if defined(__AVX512F__)
  const __m512i base = _mm512_loadu_si512(rows);
  for (int i = 0; i < n; ++i)
    s[i] = Pack(reinterpret_cast<Pack::Native>(
        _mm512_mask_i64gather_pd(_mm512_setzero_pd(), 0xff, base, reinterpret_cast<void*>(i * 8L), 1)));
#else
  for (int i = 0; i < n; ++i)
    for (int l = 0; l < kGroup; ++l) s[i].v[l] = static_cast<const double*>(rows[l])[i];
#endif
}
// T<double> behind one pointer, in all lanes.
template <Rebindable T>
void spread(const void* row, typename T::template rebind<Pack>& out) {
  Pack* s = reinterpret_cast<Pack*>(&out);
  for (std::size_t i = 0; i < sizeof(T) / sizeof(double); ++i) s[i] = Pack(static_cast<const double*>(row)[i]);
}

// One argument of eight rows over packs. A constant that the rows before had, too, is not gathered again.
template <class V>
struct PackedArgument {
  typename V::template rebind<Pack> value;
  const void* spread_from = nullptr;

  void take(const void* const* rows) {
    if constexpr (V::kDim == 0) {
      bool same = true;
      for (int l = 1; l < kGroup; ++l) same = same && rows[l] == rows[0];
      if (same && spread_from == rows[0]) return;
      spread_from = same ? rows[0] : nullptr;
      if (same) return spread<V>(rows[0], value);
    }
    gather<V>(rows, value);
  }
};

template <class Noise, std::size_t N = sizeof(Noise) / sizeof(double)>
std::array<Pack, N> gather_noise(const void* const* rows) {
  std::array<Pack, N> out;
  for (std::size_t i = 0; i < N; ++i)
    for (int l = 0; l < kGroup; ++l) out[i].v[l] = static_cast<const double*>(rows[l])[i];
  return out;
}
template <class Noise, std::size_t N = sizeof(Noise) / sizeof(double)>
std::array<double, N> noise_entries(const void* row) {
  std::array<double, N> out;
  std::memcpy(out.data(), row, sizeof(out));
  return out;
}

template <class R>
concept PackedResidual = AnalyticResidual<R> && Rebindable<R>;

// Jacobians of a residual over scalar S, one matrix a variable; constants have none.
template <class S, int D, class Vars>
struct JacobianTuple;
template <class S, int D, class... V>
struct JacobianTuple<S, D, Types<V...>> {
  struct None {};
  std::tuple<std::conditional_t<(V::kDim > 0), Mat<S, D, (V::kDim > 0 ? V::kDim : 1)>, None>...> blocks;
  // f(pointers to the blocks that exist...)
  template <class F>
  auto apply(F&& f, bool wanted) {
    return std::apply(
        [&](auto&... b) {
          auto one = [wanted](auto& m) {
            if constexpr (std::is_same_v<std::remove_reference_t<decltype(m)>, None>)
              return std::tuple<>();
            else
              return std::make_tuple(wanted ? &m : nullptr);
          };
          return std::apply(f, std::tuple_cat(one(b)...));
        },
        blocks);
  }
  template <class F>
  void for_each(F&& f) {
    int column = 0;
    std::apply(
        [&](auto&... b) {
          auto one = [&](auto& m) {
            if constexpr (!std::is_same_v<std::remove_reference_t<decltype(m)>, None>) {
              f(m, column);
              column += std::remove_reference_t<decltype(m)>::kCols;
            }
          };
          (one(b), ...);
        },
        blocks);
  }
};

inline Pack::Mask finite_mask(const Pack& p) { return (p - p) <= Pack(0.0); }

inline Pack::Mask mask_of(unsigned bits) {
  Pack::Mask m;
  for (int l = 0; l < kGroup; ++l) m.v[l] = -static_cast<long long>(bits >> l & 1u);
  return m;
}

// Bits of a mask, lane by lane.
inline unsigned bits(Pack::Mask m) {
  unsigned b = 0;
  for (int l = 0; l < kGroup; ++l) b |= (m.v[l] != 0 ? 1u : 0u) << l;
  return b;
}

template <class R, class Noise>
struct PackedRows {
  using T = ResidualTraits<R>;
  static constexpr int D = T::kDim;
  using J = JacobianTuple<Pack, D, typename R::Variables>;

  template <class Vars>
  struct ArgumentsOf;
  template <class... V>
  struct ArgumentsOf<Types<V...>> {
    using type = std::tuple<PackedArgument<V>...>;
  };
  typename ArgumentsOf<typename R::Variables>::type arguments;
  typename R::template rebind<Pack> residual;
  J j;

  template <std::size_t... I>
  Pack::Mask call(const void* const* at, int g, Vec<Pack, D>& r, bool wanted, std::index_sequence<I...>) {
    (std::get<I>(arguments).take(at + I * Batch::kRows + g), ...);
    return j.apply([&](auto*... block) { return residual.evaluate(std::get<I>(arguments).value..., r, block...); },
                   wanted);
  }
  // Whether some Jacobian of these eight rows is taken elsewhere than its residual.
  static bool is_apart(const RowPointers& rows, int g) {
    if (rows.jacobian_at == rows.at) return false;
    for (int k = 0; k < T::kArity; ++k)
      for (int l = 0; l < kGroup; ++l)
        if (rows.at[k * Batch::kRows + g + l] != rows.jacobian_at[k * Batch::kRows + g + l]) return true;
    return false;
  }

  // Rows g .. g + 7, whose pointers all are good (the last row is repeated past the end).
  void group(const RowPointers& rows, int g, Batch& out) {
    constexpr auto args = std::make_index_sequence<T::kArity>{};
    const auto noise = gather_noise<Noise>(rows.noise + g);
    const bool wanted = out.J != nullptr, apart = wanted && is_apart(rows, g);
    gather<R>(rows.measurement + g, residual);
    Vec<Pack, D> r;
    Pack::Mask valid = call(rows.at, g, r, wanted && !apart, args);
    if (apart) {
      Vec<Pack, D> unused;
      valid = valid & call(rows.jacobian_at, g, unused, true, args);
    }
    Noise::whiten(noise, r);
    const Pack s = r.squared_norm();
    Pack::Mask finite = finite_mask(s);
    Pack rho = s, weight(1.0);
    if (rows.loss != nullptr) losses(rows, g, s, rho, weight);
    if (wanted)
      j.for_each([&](auto& m, int) {
        Noise::whiten(noise, m);
        Pack sum(0.0);
        for (int i = 0; i < m.kSize; ++i) sum += m.m[i] * m.m[i];
        finite = finite & finite_mask(sum);
      });
    valid = valid & mask_of(static_cast<unsigned>(rows.active >> g) & 0xffu);
    const Pack::Mask good = valid & finite;
    out.valid |= std::uint64_t{bits(good)} << g;
    out.not_finite |= std::uint64_t{bits(valid & !finite)} << g;
    store(out.cost + g, select(good, rho * Pack(0.5), Pack(0.0)));
    for (int i = 0; i < D; ++i) store(out.r + i * Batch::kRows + g, select(good, r[i] * weight, Pack(0.0)));
    if (wanted)
      j.for_each([&](auto& m, int column) {
        for (int i = 0; i < m.kSize; ++i)
          store(out.J + (column * D + i) * Batch::kRows + g, select(good, m.m[i] * weight, Pack(0.0)));
      });
  }
  static void store(double* to, const Pack& p) { std::memcpy(to, &p.v, sizeof(p.v)); }
  // ρ and √ρ' of eight rows.
  static void losses(const RowPointers& rows, int g, const Pack& s, Pack& rho, Pack& weight) {
    for (int l = 0; l < kGroup; ++l) {
      const Loss& loss = *rows.loss[g + l];
      const auto v = evaluate_loss(loss.kind, loss.scale, s[l]);
      rho.set(l, v.rho);
      weight.set(l, std::sqrt(v.weight));
    }
  }
};

inline void clear(int l, Batch& out) {
  out.cost[l] = 0.0;
  for (int i = 0; i < out.dim; ++i) out.r[i * Batch::kRows + l] = 0.0;
  if (out.J == nullptr) return;
  for (int i = 0; i < out.dim * out.cols; ++i) out.J[i * Batch::kRows + l] = 0.0;
}

template <class R, class Noise>
struct ScalarRows {
  using T = ResidualTraits<R>;
  static constexpr int D = T::kDim;

  template <std::size_t... I>
  static bool call(const RowPointers& rows, const void* const* at, int l, Vec<double, D>& r,
                   Mat<double, D, T::kCols>* j, std::index_sequence<I...>) {
    return evaluate_residual(*static_cast<const R*>(rows.measurement[l]), r, j,
                             *static_cast<const typename T::template Var<I>*>(at[I * Batch::kRows + l])...);
  }
  static void row(const RowPointers& rows, int l, Batch& out) {
    if ((rows.active >> l & 1u) == 0) return clear(l, out);
    constexpr auto args = std::make_index_sequence<T::kArity>{};
    const auto noise = noise_entries<Noise>(rows.noise[l]);
    const bool wanted = out.J != nullptr, apart = wanted && rows.jacobian_at != rows.at;
    Vec<double, D> r = Vec<double, D>::zero();
    Mat<double, D, T::kCols> j;
    bool valid = call(rows, rows.at, l, r, wanted && !apart ? &j : nullptr, args);
    if (apart) {
      Vec<double, D> unused;
      valid = valid && call(rows, rows.jacobian_at, l, unused, &j, args);
    }
    Noise::whiten(noise, r);
    if (wanted && valid) Noise::whiten(noise, j);
    const double s = r.squared_norm();
    const bool finite = std::isfinite(s) && (!wanted || !valid || all_finite(j));
    const bool good = valid && finite;
    const std::uint64_t bit = std::uint64_t{1} << l;
    if (good) out.valid |= bit;
    if (valid && !finite) out.not_finite |= bit;
    const auto loss = good && rows.loss != nullptr ? evaluate_loss(rows.loss[l]->kind, rows.loss[l]->scale, s)
                                                   : LossValue<double>{s, 1.0};
    const double weight = std::sqrt(loss.weight);
    out.cost[l] = good ? 0.5 * loss.rho : 0.0;
    for (int i = 0; i < D; ++i) out.r[i * Batch::kRows + l] = good ? r[i] * weight : 0.0;
    if (!wanted) return;
    for (int i = 0; i < D * T::kCols; ++i) out.J[i * Batch::kRows + l] = good ? j.m[i] * weight : 0.0;
  }
};

}  // namespace detail

// Evaluates the rows of one table at a point into `out`, whose r (and J, unless null) have room for them. Inactive
// lanes and those past out.rows, up to the next multiple of eight, are not valid and hold zeros.
template <Residual R, class Noise>
void linearize_rows(const RowPointers& rows, Batch& out) noexcept {
  RowPointers in = rows;
  if (rows.rows < Batch::kRows) in.active &= (std::uint64_t{1} << rows.rows) - 1;
  out.rows = rows.rows;
  out.dim = ResidualTraits<R>::kDim;
  out.cols = ResidualTraits<R>::kCols;
  out.valid = out.not_finite = 0;
  const int end = (rows.rows + detail::kGroup - 1) / detail::kGroup * detail::kGroup;
  if constexpr (detail::PackedResidual<R>) {
    detail::PackedRows<R, Noise> packed;
    for (int g = 0; g < end; g += detail::kGroup) packed.group(in, g, out);
  } else {
    for (int l = 0; l < end; ++l) detail::ScalarRows<R, Noise>::row(in, l, out);
  }
}

}  // namespace oriel
