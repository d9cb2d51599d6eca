// Times that never had a state, limits of the ledger, its memory: a random walk against its batch.
#include <gtest/gtest.h>

#include <cmath>

#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"
#include "oriel/testing/allocation_counter.h"
#include "oriel/window/marginalize.h"
#include "residual/random_values.h"
#include "window/dense_oracle.h"

namespace oriel {
namespace {

using dense_oracle::difference;
using dense_oracle::MatrixXd;
using dense_oracle::System;
using dense_oracle::VectorXd;
using testing_values::Random;
using Point = VectorNd<3>;
using PointId = VariableId<Point>;

// A random walk whose noise splits: variance per second. The batch has every state that is ever named, the window has
// those of whole seconds and keeps the newest few.
struct Walk {
  static constexpr double kVariance = 0.3;  // [1/s]
  Graph window, batch;
  LateLedger ledger;
  Marginalizer marginalizer;
  GraphEdit edit{window};
  std::vector<PointId> states;                         // of the window, by second; also those that left
  std::vector<std::pair<double, PointId>> all, known;  // of the batch; in window or ledger: by time
  std::size_t oldest = 0;
  Random random{5};

  explicit Walk(const LateLedgerOptions& options = {}) : ledger(options) {}

  static IsotropicNoise noise(double seconds) { return Sigma(std::sqrt(kVariance * seconds)); }
  static Between<Point> motion() { return {Point{}}; }

  // Both: the next second, with a measurement.
  void grow() {
    const Point z = random.value<Point>(1.0);
    const double t = static_cast<double>(states.size());
    for (Graph* graph : {&window, &batch}) {
      GraphEdit e = graph->edit();
      const PointId x = e.add(Point{});
      e.add(Prior{z}, Sigma(0.7), x);
      if (t > 0.0) e.add(motion(), noise(1.0), graph == &window ? states.back() : all.back().second, x);
      ASSERT_TRUE(graph->apply(e).ok());
      if (graph == &window)
        states.push_back(x);
      else
        all.emplace_back(t, x);
    }
    known.emplace_back(t, states.back());
  }
  void slide() {
    const VariableKey id = states[oldest];
    ASSERT_TRUE(marginalizer.marginalize(window, {&id, 1}, {.ledger = &ledger}, edit).ok());
    apply(Time{static_cast<std::int64_t>(oldest) * 1'000'000'000});
    ++oldest;
  }
  void apply(Time stamp) {
    const auto ok = window.apply(edit);
    ASSERT_TRUE(ok.ok()) << ok.error();
    ledger.commit(stamp);
    edit.clear();
  }

  // A state at t in between: in the batch the motion is split, the ledger is given the halves.
  LateOutcome insert(double t) {
    split_in_batch(t);
    std::size_t next = 0;
    while (known[next].first < t) ++next;
    const auto [t_a, a] = known[next - 1];
    const auto [t_b, b] = known[next];
    const PointId s = ledger.lend<Point>();
    const Point guess = random.value<Point>(1.0);
    const auto before = detach(motion(), noise(t - t_a), a, s), after = detach(motion(), noise(t_b - t), s, b);
    const DetachedFactor halves[] = {before.view(), after.view()};
    const DetachedVariable state[] = {{s, &kVariableOps<Point>, &guess}};
    const LateOutcome outcome = ledger.add_state(window, state, halves);
    if (outcome == LateOutcome::folded) known.insert(known.begin() + static_cast<std::ptrdiff_t>(next), {t, s});
    ledger.commit(Time{static_cast<std::int64_t>(t * 1e9)});
    return outcome;
  }
  // The motion alone is split; relative measurements between the same two stay (they are not of zero).
  void split_in_batch(double t) {
    std::size_t next = 0;
    while (all[next].first < t) ++next;
    const auto [t_a, a] = all[next - 1];
    const auto [t_b, b] = all[next];
    GraphEdit e = batch.edit();
    batch.for_each_factor(a, [&, id = b](std::uint32_t table, std::uint32_t row) {
      const FactorTable& factors = *batch.tables()[table];
      for (const VariableRef& ref : factors.variables(row))
        if (batch.pools()[ref.pool]->slots().key_of_slot(ref.slot) == id.key && factors.arity() == 2 &&
            static_cast<const Between<Point>*>(factors.measurement(row))->measured.v.norm() == 0.0)
          e.remove(FactorId{factors.ops().key, factors.slots().key(row)});
    });
    const PointId s = e.add(Point{});
    e.add(motion(), noise(t - t_a), a, s);
    e.add(motion(), noise(t_b - t), s, b);
    ASSERT_TRUE(batch.apply(e).ok());
    all.insert(all.begin() + static_cast<std::ptrdiff_t>(next), {t, s});
  }
  static PointId at(const std::vector<std::pair<double, PointId>>& states, double t) {
    for (const auto& [time, id] : states)
      if (time == t) return id;
    return {};
  }
  // A relative measurement between two times, late or not; u == t: an absolute one.
  LateOutcome measure(double t, double u) {
    const Point z = random.value<Point>(1.0);
    GraphEdit e = batch.edit();
    const auto fold = [&](const auto& factor) { return ledger.fold(window, factor.view(), edit); };
    LateOutcome outcome;
    edit.clear();
    if (t == u) {
      e.add(Prior{z}, Sigma(0.2), at(all, t));
      outcome = fold(detach(Prior{z}, Sigma(0.2), at(known, t)));
      if (outcome == LateOutcome::live) edit.add(Prior{z}, Sigma(0.2), at(known, t));
    } else {
      e.add(Between{z}, Sigma(0.4), at(all, t), at(all, u));
      outcome = fold(detach(Between{z}, Sigma(0.4), at(known, t), at(known, u)));
      if (outcome == LateOutcome::live) edit.add(Between{z}, Sigma(0.4), at(known, t), at(known, u));
    }
    EXPECT_TRUE(batch.apply(e).ok());
    apply({});
    return outcome;
  }

  void expect_gaussian_of_batch() {
    const System few = dense_oracle::system(window), whole = dense_oracle::system(batch);
    const MatrixXd few_cov = few.H.inverse(), whole_cov = whole.H.inverse();
    const VectorXd few_step = -few_cov * few.g, whole_step = -whole_cov * whole.g;
    std::vector<VariableKey> mine, theirs;
    for (std::size_t i = oldest; i < states.size(); ++i)
      mine.push_back(states[i]), theirs.push_back(at(all, static_cast<double>(i)));
    const std::vector<int> a = few.scalars(mine), b = whole.scalars(theirs);
    EXPECT_LT(difference(few_cov(a, a), whole_cov(b, b)), 1e-9);
    for (std::size_t i = 0; i < mine.size(); ++i) {
      const Point x = window.value(PointId{mine[i].key}), y = batch.value(PointId{theirs[i].key});
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(x.v[k] + few_step[a[3 * i + k]], y.v[k] + whole_step[b[3 * i + k]], 1e-9);
    }
  }
};

// W7
TEST(LateState, AStateThatNeverWasIsAsIfItHadBeenInTime) {
  for (const bool solve_between : {false, true}) {
    Walk walk;
    NativeEngine engine(walk.window);
    for (int i = 0; i < 14; ++i) {
      walk.grow();
      if (solve_between) (void)engine.solve({.max_iterations = 2});
      if (i >= 4) walk.slide();
    }
    EXPECT_EQ(walk.insert(3.5), LateOutcome::folded);  // between two that left
    EXPECT_EQ(walk.measure(3.5, 3.5), LateOutcome::folded);
    EXPECT_EQ(walk.insert(9.25), LateOutcome::folded);         // between the last that left and the first that lives
    EXPECT_EQ(walk.measure(9.25, 3.5), LateOutcome::folded);   // a loop across all of the horizon
    EXPECT_EQ(walk.insert(3.25), LateOutcome::folded);         // between one that left and one that never was
    EXPECT_EQ(walk.measure(3.25, 12.0), LateOutcome::folded);  // to a live one
    EXPECT_EQ(walk.measure(3.5, 3.5), LateOutcome::folded);    // the same time again
    EXPECT_EQ(walk.insert(3.75), LateOutcome::folded);         // on its other side
    EXPECT_EQ(walk.measure(3.75, 2.0), LateOutcome::folded);
    EXPECT_EQ(walk.measure(11.0, 12.0), LateOutcome::live);
    walk.expect_gaussian_of_batch();
    walk.grow();
    walk.slide();
    EXPECT_EQ(walk.measure(10.0, 3.5), LateOutcome::folded);
    walk.expect_gaussian_of_batch();
  }
}

// W7
TEST(LateState, RandomTimesInRandomOrderEndAtTheBatch) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    Walk walk;
    walk.random = Random(seed);
    for (int i = 0; i < 12; ++i) {
      walk.grow();
      if (i >= 3) walk.slide();
      if (i < 5) continue;
      const double t = std::floor(walk.random.uniform(0.0, 7.0 * 16.0)) / 16.0 + 1.0 / 64.0;
      if (t < static_cast<double>(walk.oldest) && Walk::at(walk.all, t) == PointId{}) {
        EXPECT_EQ(walk.insert(t), LateOutcome::folded);
        const double u = walk.known[static_cast<std::size_t>(walk.random.uniform(0.0, 5.99))].first;
        EXPECT_EQ(walk.measure(t, u), LateOutcome::folded);
      }
    }
    walk.expect_gaussian_of_batch();
  }
}

// W7
TEST(LateState, WhatIsOlderThanTheHorizonIsRefusedAndCounted) {
  for (const LateLedgerOptions& options :
       {LateLedgerOptions{.conditionals = 3}, LateLedgerOptions{.horizon = Duration{2'000'000'000}}}) {
    Walk walk(options);
    for (int i = 0; i < 10; ++i) {
      walk.grow();
      if (i >= 2) walk.slide();
    }
    EXPECT_EQ(walk.ledger.size(), 3u);  // 5, 6 and 7
    const std::uint64_t version = walk.window.version();
    const auto old = detach(Prior{Point{}}, Sigma(0.1), walk.states[4]);
    EXPECT_EQ(walk.ledger.fold(walk.window, old.view(), walk.edit), LateOutcome::forgotten);
    const auto across = detach(Between{Point{}}, Sigma(0.1), walk.states[4], walk.states[6]);
    EXPECT_EQ(walk.ledger.fold(walk.window, across.view(), walk.edit), LateOutcome::forgotten);
    EXPECT_TRUE(walk.edit.empty());
    EXPECT_EQ(walk.window.version(), version);
    EXPECT_EQ(walk.ledger.count(LateOutcome::forgotten), 2);
    EXPECT_EQ(walk.insert(4.5), LateOutcome::forgotten);
    EXPECT_EQ(walk.ledger.size(), 3u);
    const auto kept = detach(Prior{Point{}}, Sigma(0.1), walk.states[5]);
    EXPECT_EQ(walk.ledger.fold(walk.window, kept.view(), walk.edit), LateOutcome::folded);
    walk.ledger.discard();
    walk.edit.clear();
  }
}

// W7
TEST(LateState, APathThroughARemovedVariableIsRefused) {
  Walk walk;
  for (int i = 0; i < 6; ++i) walk.grow();
  walk.slide();
  walk.slide();
  walk.edit.remove(walk.states[2]);
  walk.apply({});
  const auto on_first = detach(Prior{Point{}}, Sigma(0.1), walk.states[0]);
  EXPECT_EQ(walk.ledger.fold(walk.window, on_first.view(), walk.edit), LateOutcome::removed);
  const auto on_removed = detach(Between{Point{}}, Sigma(0.1), walk.states[2], walk.states[4]);
  EXPECT_EQ(walk.ledger.fold(walk.window, on_removed.view(), walk.edit), LateOutcome::removed);
  EXPECT_EQ(walk.ledger.count(LateOutcome::removed), 2);
  EXPECT_TRUE(walk.edit.empty());
}

TEST(LateState, WhatIsDiscardedLeavesTheLedgerAsItWas) {
  Walk walk;
  for (int i = 0; i < 8; ++i) {
    walk.grow();
    if (i >= 3) walk.slide();
  }
  const auto wrong = detach(Prior{Point{{{9, 9, 9}}}}, Sigma(0.01), walk.states[1]);
  EXPECT_EQ(walk.ledger.fold(walk.window, wrong.view(), walk.edit), LateOutcome::folded);
  EXPECT_FALSE(walk.edit.empty());
  walk.edit.clear();
  walk.ledger.discard();
  const VariableKey next = walk.states[walk.oldest];
  ASSERT_TRUE(walk.marginalizer.marginalize(walk.window, {&next, 1}, {.ledger = &walk.ledger}, walk.edit).ok());
  walk.edit.clear();
  walk.ledger.discard();
  EXPECT_FALSE(walk.ledger.holds(next));
  EXPECT_EQ(walk.measure(1.0, 6.0), LateOutcome::folded);
  walk.expect_gaussian_of_batch();
}

TEST(LateState, HalvesThatLeaveAStateOpenAreRefused) {
  Walk walk;
  for (int i = 0; i < 6; ++i) walk.grow();
  for (int i = 0; i < 3; ++i) walk.slide();
  const PointId s = walk.ledger.lend<Point>(), loose = walk.ledger.lend<Point>();
  const auto half = detach(Walk::motion(), Walk::noise(0.5), walk.states[1], s);
  const DetachedFactor halves[] = {half.view()};
  const Point guess{};
  const DetachedVariable state[] = {{s, &kVariableOps<Point>, &guess}, {loose, &kVariableOps<Point>, &guess}};
  EXPECT_EQ(walk.ledger.add_state(walk.window, state, halves), LateOutcome::undetermined);
  EXPECT_FALSE(walk.ledger.holds(s));
}

TEST(LateState, ASteadyWindowThatKeepsALedgerAsksForNoMemory) {
  if (!counts_allocations()) GTEST_SKIP() << "a sanitizer has an operator new of its own";
  Graph graph;
  GraphEdit edit(graph), fold(graph);
  LateLedger ledger({.conditionals = 20});
  Marginalizer marginalizer;
  std::vector<PointId> ids(400);
  std::int64_t steady = 0;
  for (int i = 0; i < 400; ++i) {
    const std::int64_t before = allocation_count();
    edit.clear();
    ids[i] = edit.add(Point{});
    edit.add(Prior{Point{}}, Sigma(1.0), ids[i]);
    for (int k = 1; k <= 3 && k <= i; ++k) edit.add(Walk::motion(), Walk::noise(1.0), ids[i - k], ids[i]);
    ASSERT_TRUE(graph.apply(edit).ok());
    if (i >= 10) {
      const VariableKey id = ids[i - 10];
      ASSERT_TRUE(marginalizer.marginalize(graph, {&id, 1}, {.ledger = &ledger}, fold).ok());
      ASSERT_TRUE(graph.apply(fold).ok());
      ledger.commit(Time{i});
    }
    if (i >= 100) steady += allocation_count() - before;
  }
  EXPECT_EQ(ledger.size(), 20u);
  EXPECT_EQ(steady, 0);
}

}  // namespace
}  // namespace oriel
