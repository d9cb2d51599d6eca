// From typed rows to a Batch: the one place where a residual's type meets the solver. Everything after it knows
// dimensions alone. A row is evaluated eight at a time where its residual can (S = Pack), else one by one.
#pragma once
#include <bit>
#include <cstring>
#include <utility>

#include "oriel/base/finite.h"
#include "oriel/residual/batch.h"
#include "oriel/residual/differentiate.h"
#include "oriel/residual/loss.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/residual.h"

namespace oriel {

// What was found at `at` before: a Batch without J. Rows whose Jacobian is taken elsewhere need not be evaluated again.
struct EvaluatedRows {
  std::uint64_t valid = 0;
  const double* r = nullptr;       // as Batch::r
  const double* weight = nullptr;  // as Batch::weight; null: no row has a loss
  const double* cost = nullptr;
};

// Where up to 64 rows find what they need. Argument k of row l: at[k * Batch::kRows + l].
struct RowPointers {
  int rows = 0;
  std::uint64_t active = ~std::uint64_t{0};  // lanes that count; the others only fill up a group of eight
  bool robust = false;                       // whether rows have losses
  const void* const* measurement = nullptr;
  const void* const* noise = nullptr;
  const Loss* const* loss = nullptr;
  // Or all three, for residuals that are evaluated eight rows at a time: by groups of eight, measurement, noise, and
  // scale and kind of the loss if robust, as packs.
  const double* packed = nullptr;
  const void* const* at = nullptr;  // the values, for r
  // Where Jacobians are taken: the same as `at`, or first estimates for the variables that have one (decision 9).
  const void* const* jacobian_at = nullptr;
  const EvaluatedRows* evaluated = nullptr;
};

namespace detail {

constexpr int kGroup = Pack::kLanes;
constexpr int kLossPacks = 3;  // scale, kind, and where the loss stands
static_assert(sizeof(void*) == sizeof(double));

// N doubles behind each of eight pointers → N packs.
template <int N>
void gather_doubles(const void* const* rows, Pack* to) {
#if defined(__AVX512F__) && !defined(__clang__)
  Pack::NativeMask base;
  std::memcpy(&base, rows, sizeof(base));
  for (int i = 0; i < N; ++i)
    to[i].v[0] =
        __builtin_ia32_gatherdiv8df(Pack::Native{}, reinterpret_cast<void*>(i * 8L), base, static_cast<char>(-1), 1);
#else
  // Put together in registers: lanes that are stored one by one cannot be forwarded to a load of the whole.
  const auto part = [rows]<int... L>(int first, int i, std::integer_sequence<int, L...>) {
    return Pack::Native{static_cast<const double*>(rows[first + L])[i]...};
  };
  for (int i = 0; i < N; ++i)
    to[i] = Pack::each<Pack>(
        [&](int p) { return part(p * Pack::kNative, i, std::make_integer_sequence<int, Pack::kNative>{}); });
#endif
}
// T<double> behind eight pointers → T<Pack>, whose members all are packs and stand in the same order.
template <Rebindable T>
void gather(const void* const* rows, typename T::template rebind<Pack>& out) {
  static_assert(sizeof(out) == sizeof(T) / sizeof(double) * sizeof(Pack));
  gather_doubles<sizeof(T) / sizeof(double)>(rows, reinterpret_cast<Pack*>(&out));
}
// T<double> behind one pointer, in all lanes.
template <Rebindable T>
void spread(const void* row, typename T::template rebind<Pack>& out) {
  Pack* s = reinterpret_cast<Pack*>(&out);
  for (std::size_t i = 0; i < sizeof(T) / sizeof(double); ++i) s[i] = Pack(static_cast<const double*>(row)[i]);
}

// One argument of eight rows over packs. What all eight share, and what the rows before had, is not gathered again:
// constants, and the poses of rows in runs.
template <class V>
struct PackedArgument {
  typename V::template rebind<Pack> value;
  const void* spread_from = nullptr;

  void take(const void* const* rows) {
    bool same = true;
    for (int l = 1; l < kGroup; ++l) same &= rows[l] == rows[0];
    if (same && spread_from == rows[0]) return;
    spread_from = same ? rows[0] : nullptr;
    if (same)
      spread<V>(rows[0], value);
    else
      gather<V>(rows, value);
  }
};

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
template <class S, int D>
struct JacobianTuple<S, D, Types<>> {
  template <class F>
  void for_each(F&&, int = 0) {}
  template <class F, class... P>
  auto apply(F&& f, bool, P*... before) {
    return f(before...);
  }
};
// Not a std::tuple, which would fill it with zeros.
template <class S, int D, class V, class... Rest>
struct JacobianTuple<S, D, Types<V, Rest...>> {
  static constexpr bool kHas = V::kDim > 0;
  struct None {};
  std::conditional_t<kHas, Mat<S, D, (kHas ? V::kDim : 1)>, None> block;
  JacobianTuple<S, D, Types<Rest...>> rest;

  // f(pointers to the blocks that exist...), null where they are not wanted.
  template <class F, class... P>
  auto apply(F&& f, bool wanted, P*... before) {
    if constexpr (kHas)
      return rest.apply(f, wanted, before..., wanted ? &block : nullptr);
    else
      return rest.apply(f, wanted, before...);
  }
  // f(block, its first column)
  template <class F>
  void for_each(F&& f, int column = 0) {
    if constexpr (kHas) f(block, column);
    rest.for_each(f, column + V::kDim);
  }
};

inline Pack::Mask finite_mask(const Pack& p) { return (p - p) <= Pack(0.0); }

// Whether all entries are finite, lane by lane: a sum of their squares is, but for values that overflow. Four sums, so
// that none waits for the one before.
template <int R, int C>
Pack::Mask finite_mask(const Mat<Pack, R, C>& m) {
  Pack sum[4] = {Pack(0.0), Pack(0.0), Pack(0.0), Pack(0.0)};
#pragma GCC unroll 90
  for (int i = 0; i < m.kSize; ++i) sum[i % 4] += m.m[i] * m.m[i];
  return finite_mask((sum[0] + sum[1]) + (sum[2] + sum[3]));
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
  J j;

  // RowPointers::packed of eight rows: the members of the residual, of the noise, and the losses.
  using Measurement = typename R::template rebind<Pack>;
  struct Numbers {
    Measurement measurement;
    std::array<Pack, sizeof(Noise) / sizeof(double)> noise;
    Pack loss_scale, loss_kind;
    const Loss* loss[kGroup];
  };
  static constexpr int kNumbers = static_cast<int>((sizeof(R) + sizeof(Noise)) / sizeof(double));
  Numbers numbers_;  // where they are not packed already

  const Numbers& numbers(const RowPointers& rows, int g) {
    static_assert(sizeof(Numbers) == (kNumbers + kLossPacks) * sizeof(Pack));
    if (rows.packed != nullptr)  // without losses, the last are the next group's, and not looked at
      return *reinterpret_cast<const Numbers*>(rows.packed +
                                               (kNumbers + (rows.robust ? kLossPacks : 0)) * std::ptrdiff_t{g});
    Pack* const to = reinterpret_cast<Pack*>(&numbers_);
    gather_doubles<sizeof(R) / sizeof(double)>(rows.measurement + g, to);
    gather_doubles<sizeof(Noise) / sizeof(double)>(rows.noise + g, to + sizeof(R) / sizeof(double));
    for (int l = 0; rows.robust && l < kGroup; ++l) {
      numbers_.loss_scale.set(l, rows.loss[g + l]->scale);
      numbers_.loss_kind.set(l, static_cast<double>(rows.loss[g + l]->kind));
      numbers_.loss[l] = rows.loss[g + l];
    }
    return numbers_;
  }

  template <std::size_t... I>
  Pack::Mask call(const Measurement& m, const void* const* at, int g, Vec<Pack, D>& r, bool wanted,
                  std::index_sequence<I...>) {
    (std::get<I>(arguments).take(at + I * Batch::kRows + g), ...);
    return j.apply([&](auto*... block) { return m.evaluate(std::get<I>(arguments).value..., r, block...); }, wanted);
  }
  // Whether some Jacobian of these eight rows is taken elsewhere than its residual.
  static bool is_apart(const RowPointers& rows, int g) {
    if (rows.jacobian_at == rows.at) return false;
    bool apart = false;
    for (int k = 0; k < T::kArity; ++k)
      for (int l = 0; l < kGroup; ++l)
        apart |= rows.at[k * Batch::kRows + g + l] != rows.jacobian_at[k * Batch::kRows + g + l];
    return apart;
  }

  // Rows g .. g + 7, whose pointers all are good (the last row is repeated past the end).
  void group(const RowPointers& rows, int g, Batch& out) {
    constexpr auto args = std::make_index_sequence<T::kArity>{};
    const Numbers& given = numbers(rows, g);
    const bool wanted = out.J != nullptr, apart = wanted && is_apart(rows, g);
    const bool evaluated = apart && rows.evaluated != nullptr;
    Vec<Pack, D> r;
    Row row;
    if (evaluated)
      recall(*rows.evaluated, g, r, row);
    else
      row.valid = call(given.measurement, rows.at, g, r, wanted && !apart, args);
    if (apart) {
      Vec<Pack, D> unused;
      row.valid = row.valid & call(given.measurement, rows.jacobian_at, g, unused, true, args);
    }
    if (!evaluated) weigh(given, rows.robust, r, row);
    if (wanted)
      j.for_each([&](auto& m, int) {
        Noise::whiten(given.noise, m);
        row.finite = row.finite & finite_mask(m);
      });
    const Pack::Mask valid = row.valid & mask_of(static_cast<unsigned>(rows.active >> g) & 0xffu);
    const Pack::Mask good = valid & row.finite;
    out.valid |= std::uint64_t{bits(good)} << g;
    out.not_finite |= std::uint64_t{bits(valid & !row.finite)} << g;
    store(out.cost + g, select(good, row.cost, Pack(0.0)));
    if (rows.robust) store(out.weight + g, row.weight);
    for (int i = 0; i < D; ++i) store(out.r + i * Batch::kRows + g, select(good, r[i], Pack(0.0)));
    if (wanted)
      j.for_each([&](auto& m, int column) {
        for (int i = 0; i < m.kSize; ++i)
          store(out.J + (column * D + i) * Batch::kRows + g, select(good, m.m[i] * row.weight, Pack(0.0)));
      });
  }
  // What eight rows have besides r and J.
  struct Row {
    Pack::Mask valid, finite;
    Pack cost, weight;
  };
  // Whitens r, and scales it by √ρ'.
  static void weigh(const Numbers& given, bool robust, Vec<Pack, D>& r, Row& row) {
    Noise::whiten(given.noise, r);
    const Pack s = r.squared_norm();
    row.finite = finite_mask(s);
    row.weight = Pack(1.0);
    row.cost = s * Pack(0.5);
    if (!robust) return;
    const auto loss = evaluate_losses(given.loss, given.loss_kind, given.loss_scale, s, row.valid & row.finite);
    row.weight = sqrt(loss.weight);
    row.cost = loss.rho * Pack(0.5);
    for (int i = 0; i < D; ++i) r[i] *= row.weight;
  }
  static void recall(const EvaluatedRows& before, int g, Vec<Pack, D>& r, Row& row) {
    const unsigned valid = static_cast<unsigned>(before.valid >> g) & 0xffu;
    row.valid = mask_of(valid);
    row.finite = mask_of(0xffu);
    row.cost = load(before.cost + g);
    row.weight = before.weight != nullptr ? load(before.weight + g) : Pack(1.0);
    for (int i = 0; i < D; ++i) r[i] = load(before.r + i * Batch::kRows + g);
  }
  static Pack load(const double* from) { return Pack::load(from); }
  static void store(double* to, const Pack& p) { p.store(to); }
};

inline void clear(int l, Batch& out) {
  out.cost[l] = out.weight[l] = 0.0;
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
    const auto loss = good && rows.robust ? evaluate_loss(*rows.loss[l], s) : LossValue<double>{s, 1.0};
    const double weight = std::sqrt(loss.weight);
    out.cost[l] = good ? 0.5 * loss.rho : 0.0;
    if (rows.robust) out.weight[l] = weight;
    for (int i = 0; i < D; ++i) out.r[i * Batch::kRows + l] = good ? r[i] * weight : 0.0;
    if (!wanted) return;
    for (int i = 0; i < D * T::kCols; ++i) out.J[i * Batch::kRows + l] = good ? j.m[i] * weight : 0.0;
  }
};

}  // namespace detail

// Whether the rows of a residual are evaluated eight at a time.
template <class R>
inline constexpr bool kEvaluatedInPacks = detail::PackedResidual<R>;

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
