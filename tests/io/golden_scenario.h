// A run that every journal of the golden files holds, small and exact: all its numbers are the same on any machine.
#pragma once
#include <gtest/gtest.h>

#include <cstring>

#include "oriel/io/journal.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"

namespace oriel::golden {

inline TypeList types() {
  TypeList list;
  list.factor<Prior<Point3d>, IsotropicNoise>().factor<Between<Point3d>, IsotropicNoise>();
  return list;
}

inline Point3d point(double x, double y, double z) { return {{{x, y, z}}}; }

// A prior over one point that says that it is where it is.
inline LinearPrior prior_on(VariableId<Point3d> id, const Point3d& x) {
  LinearPrior p;
  p.variables = {id};
  p.estimates.resize(estimate_doubles(kVariableOps<Point3d>));
  std::memcpy(p.estimates.data(), &x, sizeof(x));
  p.rows = p.cols = 3;
  p.d.assign(3, 0.0);
  p.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  return p;
}

struct Scenario {
  Graph graph;
  VariableId<Point3d> start, held, late;
  FactorId first;

  Scenario() {
    GraphEdit edit = graph.edit();
    start = edit.add(point(0, 0, 0), Label("start"));
    held = edit.add(point(4, 0, 0));
    edit.fix(held);
    first = edit.add(Prior{point(1, 2, 3)}, Sigma(1.0), Huber(8.0), start);
    EXPECT_TRUE(graph.apply(edit));
  }

  // `whole`: it falls behind at the end. `restricts`: directions are held, of what comes and of what is there.
  void record(const std::string& path, bool whole, bool restricts = false) {
    auto journal = JournalWriter::create(path, graph);
    ASSERT_TRUE(journal) << journal.error();
    NativeEngine engine(graph);
    SolveOptions options;
    options.method = Method::gauss_newton;
    const SolverState before = engine.state();
    const Summary summary = engine.solve(options);
    ASSERT_GT(summary.accepted, 0);
    journal->solved(options, before, summary, engine);
    change(restricts);
    journal->edited();
    GraphEdit edit = graph.edit();
    edit.remove(held);
    ASSERT_TRUE(graph.apply(edit));
    journal->edited();
    if (whole) graph.bound_log({.per_live = 0.0, .least = 0});
    for (int i = 1; whole && i < 3; ++i) {
      edit.clear();
      edit.set(late, point(i, 0, 0));
      ASSERT_TRUE(graph.apply(edit));
    }
    const auto ok = journal->close();
    ASSERT_TRUE(ok) << ok.error();
  }

 private:
  void change(bool restricts) {
    GraphEdit edit = graph.edit();
    late = edit.add(point(1, 1, 1), Label("late"));
    edit.add(Between{point(-3, 1, 1)}, Sigma(0.5), held, late);
    edit.add(prior_on(late, point(1, 1, 1)));
    edit.set(held, point(5, 0, 0));
    edit.fix(held, false);
    edit.set(first, TruncatedSquares(4.0, 0.5));
    if (restricts) edit.set(late, Freedom::hold({1})), edit.set(start, Freedom::hold({0, 2}, Freedom::Axes::world));
    ASSERT_TRUE(graph.apply(edit));
  }
};

}  // namespace oriel::golden
