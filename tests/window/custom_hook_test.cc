// A user's rule about what enters: a hook sees each group once it is in the graph.
#include <gtest/gtest.h>

#include "rail.h"

namespace {

using namespace oriel;  // NOLINT(google-build-using-namespace): as a user would write it
using namespace oriel::rail;

// The rail is so long; a mark beyond its end is none.
class OnTheRail final : public InsertionHook {
 public:
  explicit OnTheRail(double length) : length_(length) {}
  std::string_view name() const override { return "on the rail"; }
  Verdict inserted(const Graph& graph, const States&, const InsertedGroup& group, GraphEdit& edit) override {
    (void)edit;  // what is put in here would be applied if it does not reject
    for (const FactorId id : group.factors)
      for (const auto& table : graph.tables()) {
        if (table->ops().key != id.table || table->ops().residual != Prior<Along>::kName) continue;
        const auto* mark = static_cast<const Prior<Along>*>(table->measurement(table->slots().find(id.key)));
        if (mark->value.v[0] > length_) return {.reject = true, .reason = "beyond the end of the rail"};
      }
    return {};
  }

 private:
  double length_;
};

TEST(CustomHook, RejectsAGroupAndTheStateThatWasMadeForIt) {  // W9
  Rail rail;
  rail.window.add(std::make_unique<OnTheRail>(100.0));
  rail.pass(0.0, at_s(0));
  rail.pass(170.0, at_s(7));
  rail.pass(20.0, at_s(20));
  const WindowUpdate& update = rail.window.update();
  EXPECT_EQ(update.entered, 2);
  EXPECT_STREQ(update.rejection, "beyond the end of the rail");
  EXPECT_EQ(rail.window.states().timeline(rail.wheel).find(at_s(7)), nullptr);
  EXPECT_NEAR(rail.where(at_s(20)), 20.0, 1e-6);
}

}  // namespace
