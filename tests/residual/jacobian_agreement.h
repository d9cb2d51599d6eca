// Behaviour V10 for one residual at one point: Jacobians in three ways, and eight rows at once against one row.
#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "oriel/residual/check_jacobian.h"

namespace oriel {

template <class R, class... V>
void expect_agreement(const R& residual, const V&... x) {
  const JacobianCheck check = check_jacobian(residual, x...);
  EXPECT_TRUE(check.valid) << R::kName;
  EXPECT_LT(check.analytic_and_dual, 1e-12) << R::kName << ": " << check;
  EXPECT_LT(check.worst(), 1e-8) << R::kName << ": " << check;
}

// Values and Jacobians of one row with S = Pack, lane 3, against S = double.
template <class R, class... V>
void expect_pack_equals_double(const R& residual, const V&... x) {
  using T = ResidualTraits<R>;
  Vec<double, T::kDim> r;
  Mat<double, T::kDim, T::kCols> J;
  ASSERT_TRUE(evaluate_residual(residual, r, &J, x...));
  Vec<Pack, T::kDim> packed;
  auto blocks = std::make_tuple(Mat<Pack, T::kDim, (V::kDim > 0 ? V::kDim : 1)>{}...);
  const auto valid = [&]<std::size_t... I>(std::index_sequence<I...>) {
    auto one = [](auto& block, auto dim) {
      if constexpr (decltype(dim)::value > 0)
        return std::make_tuple(&block);
      else
        return std::tuple<>();
    };
    return std::apply([&](auto*... b) { return cast<Pack>(residual).evaluate(cast<Pack>(x)..., packed, b...); },
                      std::tuple_cat(one(std::get<I>(blocks), std::integral_constant<int, T::kDims[I]>{})...));
  }
  (std::make_index_sequence<T::kArity>{});
  EXPECT_TRUE(valid[3]);
  for (int i = 0; i < T::kDim; ++i) EXPECT_NEAR(packed[i][3], r[i], 1e-13 * (1.0 + std::fabs(r[i]))) << R::kName;
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    auto compare = [&](const auto& block, auto dim, int column) {
      if constexpr (decltype(dim)::value > 0)
        for (int c = 0; c < decltype(dim)::value; ++c)
          for (int i = 0; i < T::kDim; ++i) {
            const double expected = J(i, column + c);
            EXPECT_NEAR(block(i, c)[3], expected, 1e-12 * (1.0 + std::fabs(expected))) << R::kName;
          }
    };
    (compare(std::get<I>(blocks), std::integral_constant<int, T::kDims[I]>{}, T::column(I)), ...);
  }
  (std::make_index_sequence<T::kArity>{});
}

template <class R, class... V>
void expect_all(const R& residual, const V&... x) {
  expect_agreement(residual, x...);
  expect_pack_equals_double(residual, x...);
}

}  // namespace oriel
