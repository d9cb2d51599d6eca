// A linear window that has slid.
#pragma once
#include <gtest/gtest.h>

#include "linear_window.h"

namespace oriel::linear_world {

struct SteadyLinearWindow : ::testing::Test {
  LinearWindow w{4, 11};
  int k = 0;
  const WindowUpdate& frame() {
    w.move_to(100 * k + 100);
    w.give({w.position_at(100 * k), w.sight(100 * k, k / 3)});
    ++k;
    return w.window.update();
  }
  void SetUp() override {
    while (k < 8) ASSERT_EQ(frame().status, WindowUpdate::Status::updated);
  }
};

}  // namespace oriel::linear_world
