// What hooks may do to what is in the window, and that it goes on as if it had come so.
#include <gtest/gtest.h>

#include <functional>

#include "oriel/graph/fingerprint.h"
#include "steady_window.h"

namespace oriel {
namespace {

using namespace linear_world;
using HookEdits = SteadyLinearWindow;
using Status = WindowUpdate::Status;
using Look = std::function<void(const Graph&, const InsertedGroup&, GraphEdit&)>;

struct Custom final : InsertionHook {
  Look look;
  std::string_view name() const override { return "custom"; }
  Verdict inserted(const Graph& graph, const States&, const InsertedGroup& in, GraphEdit& edit) override {
    if (look) look(graph, in, edit);
    return {};
  }
};
Custom& add_hook(SlidingWindow& window) {
  auto hook = std::make_unique<Custom>();
  Custom& custom = *hook;
  window.add(std::move(hook));
  return custom;
}

const FactorTable& table_of(const Graph& graph, FactorId id) {
  return **std::find_if(graph.tables().begin(), graph.tables().end(),
                        [&](const auto& t) { return t->ops().key == id.table; });
}
template <class R>
const R& measurement_of(const Graph& graph, FactorId id) {
  const FactorTable& table = table_of(graph, id);
  return *static_cast<const R*>(table.measurement(table.slots().find(id.key)));
}
VariableKey variable_of(const Graph& graph, FactorId id, std::size_t k) {
  const FactorTable& table = table_of(graph, id);
  const VariableRef ref = table.variables(table.slots().find(id.key))[k];
  return {graph.pools()[ref.pool]->ops().key, graph.pools()[ref.pool]->slots().key_of_slot(ref.slot)};
}

// W9
TEST_F(HookEdits, WeighAFactorAnewByItsNoise) {
  Custom& hook = add_hook(w.window);
  hook.look = [](const Graph& graph, const InsertedGroup& in, GraphEdit& edit) {
    const FactorId id = in.factors[0];
    const auto x = VariableId<Position>{variable_of(graph, id, 0).key};
    edit.remove(id);
    edit.add(measurement_of<Prior<Position>>(graph, id), Sigma(2.5), x);
  };
  w.move_to(1000);
  w.give({w.position_at(800)});
  ASSERT_EQ(w.window.update().status, Status::updated);
  w.builder->taken.back()[0].sigma = 2.5;
  EXPECT_LT(w.error(), 1e-9);
  hook.look = nullptr;
  k = 10;
  while (k < 20) ASSERT_EQ(frame().status, Status::updated);
  EXPECT_LT(w.error(), 1e-9);
}

// W9
TEST_F(HookEdits, WeighAFactorAnewByItsLoss) {
  FactorId seen;
  add_hook(w.window).look = [&](const Graph&, const InsertedGroup& in, GraphEdit& edit) {
    seen = in.factors[1];
    edit.set(seen, Cauchy(0.7));
  };
  w.move_to(1000);
  w.give({w.position_at(800), w.position_at(800)});
  ASSERT_EQ(w.window.update().status, Status::updated);
  const FactorTable& table = table_of(w.window.graph(), seen);
  ASSERT_TRUE(w.window.graph().contains(seen));
  EXPECT_EQ(table.loss(table.slots().find(seen.key)).kind, LossKind::cauchy);
  EXPECT_EQ(table.loss(table.slots().find(seen.key)).scale, 0.7);
}

// W9
TEST_F(HookEdits, TriangulateWhatCameWithTheGroupAndMoveOtherVariables) {
  const VariableKey other = w.window.states().timeline(w.positions).oldest()->variables[0];
  Custom &first = add_hook(w.window), &second = add_hook(w.window);
  first.look = [&](const Graph& graph, const InsertedGroup& in, GraphEdit& edit) {
    ASSERT_EQ(in.variables.size(), 1u);
    const auto x = VariableId<Position>{variable_of(graph, in.factors[0], 0).key};
    const Vec2d seen = measurement_of<Sight>(graph, in.factors[0]).seen;
    edit.set(VariableId<Point2d>{in.variables[0].key}, Point2d{graph.value(x).v + seen});
    edit.set(VariableId<Position>{other.key}, Position{{{7.0, 8.0}}});
  };
  int looked = 0;
  second.look = [&](const Graph& graph, const InsertedGroup& in, GraphEdit&) {
    const auto x = VariableId<Position>{variable_of(graph, in.factors[0], 0).key};
    const Vec2d seen = measurement_of<Sight>(graph, in.factors[0]).seen;
    EXPECT_EQ(graph.value(VariableId<Point2d>{in.variables[0].key}).p, graph.value(x).v + seen);
    EXPECT_EQ(graph.value(VariableId<Position>{other.key}).v, (Vec2d{{7.0, 8.0}}));
    ++looked;
  };
  w.move_to(1000);
  w.give({w.sight(800, 50)});
  ASSERT_EQ(w.window.update().status, Status::updated);
  EXPECT_EQ(looked, 1);
  EXPECT_LT(w.error(), 1e-9);
}

// W9: what is seen from the second sighting on is another point after all.
TEST_F(HookEdits, SplitATrackThatIsInTheWindowAlready) {
  struct Seen {
    FactorId factor;
    VariableId<Position> x;
    Sight what;
  };
  std::vector<Seen> seen;
  VariableId<Point2d> second;
  Custom& hook = add_hook(w.window);
  hook.look = [&](const Graph& graph, const InsertedGroup& in, GraphEdit& edit) {
    const FactorId id = in.factors[0];
    seen.push_back({id, VariableId<Position>{variable_of(graph, id, 0).key}, measurement_of<Sight>(graph, id)});
    if (seen.size() < 3) return;
    second = edit.add(Point2d{});
    for (std::size_t i = 1; i < seen.size(); ++i) {
      edit.remove(seen[i].factor);
      edit.add(seen[i].what, Sigma(0.2), seen[i].x, second);
    }
  };
  w.move_to(1200);
  for (const int ms : {800, 900, 1000}) {
    Measured m = w.sight(ms, 60);
    m.sigma = 0.2;
    w.give({m});
    ASSERT_EQ(w.window.update().entered, 1);
  }
  ASSERT_TRUE(w.window.graph().contains(second));
  // To the truth the two last sightings are of landmark 61.
  w.builder->landmarks.resize(62);
  w.builder->landmarks[61] = second;
  int moved = 0;
  for (MeasuredGroup& group : w.builder->taken)
    for (Measured& m : group)
      if (m.kind == Measured::Kind::sight && m.landmark == 60 && m.a > at_ms(800)) m.landmark = 61, ++moved;
  EXPECT_EQ(moved, 2);
  EXPECT_LT(w.error(), 1e-9);
  hook.look = nullptr;
  for (k = 12; k < 22;) {
    w.give({w.sight(100 * k, 61)});
    ASSERT_EQ(frame().status, Status::updated);
    ASSERT_LT(w.error(), 1e-9) << "frame " << k;
  }
}

// W9: a factor and a variable of other groups.
TEST_F(HookEdits, TakeOutFactorsAndLandmarksOfOtherGroups) {
  w.move_to(1000);
  w.give({w.sight(800, 70)});
  w.give({w.position_at(800)});
  ASSERT_EQ(w.window.update().status, Status::updated);
  const VariableId<Point2d> landmark = *w.builder->landmarks[70];
  const FactorId old = w.builder->taken_factors.back()[0];
  add_hook(w.window).look = [&](const Graph&, const InsertedGroup&, GraphEdit& edit) {
    edit.remove(old);
    edit.remove(landmark);  // and with it its sighting
  };
  w.give({w.step(600, 800)});
  ASSERT_EQ(w.window.update().entered, 1);
  EXPECT_FALSE(w.window.graph().contains(old));
  EXPECT_FALSE(w.window.graph().contains(landmark));
  std::erase_if(w.builder->taken, [&](const MeasuredGroup& g) {
    return (g[0].kind == Measured::Kind::sight && g[0].landmark == 70) ||
           (g.size() == 1 && g[0].kind == Measured::Kind::position && g[0].a == at_ms(800));
  });
  EXPECT_LT(w.error(), 1e-9);
}

}  // namespace
}  // namespace oriel
