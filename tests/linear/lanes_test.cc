#include "oriel/linear/lanes.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace oriel {
namespace {

using namespace lanes;

TEST(Lanes, TurnATileOver) {
  V8 x[8];
  for (int k = 0; k < 8; ++k)
    for (int l = 0; l < 8; ++l) x[k].set(l, 10.0 * k + l);
  constexpr int kWide = 11;
  double to[8 * kWide];
  std::fill_n(to, 8 * kWide, -1.0);
  store_by_lane(x, to, kWide);
  for (int l = 0; l < 8; ++l)
    for (int k = 0; k < kWide; ++k) EXPECT_EQ(to[l * kWide + k], k < 8 ? 10.0 * k + l : -1.0) << l << ' ' << k;
}

template <int D>
void expect_sums() {
  Native x[D];
  double expected[D] = {};
  for (int k = 0; k < D; ++k)
    for (int l = 0; l < kNative; ++l) x[k][l] = 1 << (2 * k + l), expected[k] += 1 << (2 * k + l);
  alignas(64) double sums[16];
  store_sums<D>(x, sums);
  double to[D + 1];
  std::fill_n(to, D + 1, 1.0);
  add<D>(to, sums);
  for (int k = 0; k < D; ++k) EXPECT_EQ(sums[k], expected[k]) << D << ' ' << k;
  for (int k = 0; k <= D; ++k) EXPECT_EQ(to[k], k < D ? 1.0 + expected[k] : 1.0) << D << ' ' << k;
}

TEST(Lanes, SumEachVectorAndAddAsManyAsAreWanted) {
  expect_sums<1>();
  expect_sums<2>();
  expect_sums<3>();
  expect_sums<4>();
  expect_sums<6>();
  expect_sums<7>();
  expect_sums<8>();
  expect_sums<9>();
}

}  // namespace
}  // namespace oriel
