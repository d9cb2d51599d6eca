// A user's choice of who leaves: states where the cart had hardly moved are taken out, the oldest is marginalized.
#include <gtest/gtest.h>

#include "rail.h"

namespace {

using namespace oriel;  // NOLINT(google-build-using-namespace): as a user would write it
using namespace oriel::rail;

class Spaced final : public WindowPolicy {
 public:
  Spaced(ProviderId cart, double spacing, std::size_t states) : cart_(cart), spacing_(spacing), most_(states) {}
  void choose(const Graph& graph, const States& states, std::vector<LeavingState>& leaving) override {
    const Timeline<State>& line = states.timeline(cart_);
    auto at = [&](std::size_t k) { return graph.value(WheelStates::id(line[k])).v[0]; };
    const std::size_t n = line.size();
    // The last but one, once the newest shows that it was of little use.
    if (n > 2 && at(n - 2) - at(n - 3) < spacing_)
      leaving.push_back({cart_, line[n - 2].time, LeavingState::How::remove});
    if (n > most_) leaving.push_back({cart_, line[0].time, LeavingState::How::marginalize});
  }

 private:
  ProviderId cart_;
  double spacing_;  // [m]
  std::size_t most_;
};

TEST(CustomPolicy, KeepsStatesThatAreFarEnoughApart) {  // W11
  Rail rail;
  rail.window.set(std::make_unique<Spaced>(rail.wheel, 2.5, 5));
  int removed = 0, marginalized = 0;
  for (int s = 0; s <= 40; ++s) {
    rail.pass(s, at_s(s));
    const WindowUpdate& update = rail.window.update();
    ASSERT_EQ(update.status, WindowUpdate::Status::updated) << update.error.message;
    removed += update.states_removed, marginalized += update.states_marginalized;
  }
  const auto& line = rail.window.states().timeline(rail.wheel);
  EXPECT_LE(line.size(), 6u);
  for (std::size_t k = 1; k + 1 < line.size(); ++k)
    EXPECT_GE(rail.where(line[k].time) - rail.where(line[k - 1].time), 2.5);
  EXPECT_GT(removed, 20);
  EXPECT_GT(marginalized, 5);
  EXPECT_NEAR(rail.where(at_s(40)), 40.0, 1e-6);
}

}  // namespace
