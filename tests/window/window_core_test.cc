// A graph, its engine and its marginalizer in step, and who watches them.
#include "oriel/window/window_core.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"

namespace oriel {
namespace {

using V = VectorNd<2>;

struct Watcher final : WindowObserver {
  int edits = 0, solves = 0;
  void edited() override { ++edits; }
  void solved(const SolveOptions&, const SolverState&, const Summary&, const NativeEngine&) override { ++solves; }
};

// Whose worker is lost: the first solve is begun and not finished, the second not begun.
struct Lost final : DeferredSolver {
  int begun = 0;
  std::string_view name() const override { return "lost"; }
  Result<void> begin(const SolveOptions&) noexcept override {
    if (begun++ == 0) return {};
    return Error{ErrorCode::io, "no worker is left"};
  }
  bool is_running() noexcept override { return false; }
  Summary finish() noexcept override { return refused({}, Error{ErrorCode::io, "killed by signal 9 (Killed)"}); }
};

// x_0 known, and a chain of steps (1, 0.5) from it.
struct Chain {
  WindowCore window;
  std::vector<VariableId<V>> x;
  void grow() {
    GraphEdit& edit = window.edit();
    x.push_back(edit.add(V{}));
    if (x.size() == 1)
      edit.add(Prior{V{}}, Sigma(0.1), x[0]);
    else
      edit.add(Between{V{{{1.0, 0.5}}}}, Sigma(0.2), x[x.size() - 2], x.back());
    EXPECT_TRUE(window.commit().ok());
  }
};

// W12
TEST(WindowCore, EndsAtTheBatchSolutionOfALinearChainWhereverItSlides) {
  Chain chain;
  for (int k = 0; k < 30; ++k) {
    chain.grow();
    ASSERT_TRUE(chain.window.solve({}).converged());
    if (k < 4) continue;
    const VariableKey oldest[] = {chain.x[k - 4]};
    ASSERT_TRUE(chain.window.slide(oldest, {}).ok());
  }
  EXPECT_EQ(chain.window.graph().count<V>(), 4u);
  const V newest = chain.window.graph().value(chain.x.back());
  EXPECT_NEAR(newest.v[0], 29.0, 1e-9);
  EXPECT_NEAR(newest.v[1], 14.5, 1e-9);
}

TEST(WindowCore, TellsAnObserverOfEveryEditAndSolve) {
  Chain chain;
  Watcher watcher;
  chain.window.observe(&watcher);
  chain.grow();
  chain.grow();
  ASSERT_TRUE(chain.window.solve({}).converged());
  const VariableKey oldest[] = {chain.x[0]};
  ASSERT_TRUE(chain.window.slide(oldest, {}).ok());
  EXPECT_EQ(watcher.edits, 3);
  EXPECT_EQ(watcher.solves, 1);
  (void)chain.window.edit();
  ASSERT_TRUE(chain.window.commit().ok());  // nothing in it
  EXPECT_EQ(watcher.edits, 3);
}

TEST(WindowCore, IsAsItWasAfterARefusedEditOrSlide) {
  Chain chain;
  Watcher watcher;
  chain.grow();
  chain.grow();
  chain.window.observe(&watcher);
  const std::uint64_t version = chain.window.graph().version();
  chain.window.edit().add(Prior{V{{{NAN, 0.0}}}}, Sigma(0.1), chain.x[0]);
  EXPECT_FALSE(chain.window.commit().ok());
  const VariableKey unknown[] = {VariableId<V>{{77, 3}}};
  EXPECT_FALSE(chain.window.slide(unknown, {}).ok());
  EXPECT_EQ(chain.window.graph().version(), version);
  EXPECT_EQ(watcher.edits, 0);
  chain.grow();
  EXPECT_TRUE(chain.window.solve({}).converged());
}

TEST(WindowCore, IsEmptyAfterItWasCleared) {
  Chain chain;
  for (int k = 0; k < 5; ++k) chain.grow();
  ASSERT_TRUE(chain.window.clear().ok());
  EXPECT_EQ(chain.window.graph().variable_count(), 0u);
  EXPECT_EQ(chain.window.graph().factor_count(), 0u);
}

// R5
TEST(WindowCore, CountsTheSolvesThatWereRefusedAndKeepsTheWordsOfTheFirst) {
  Chain chain;
  chain.grow();
  ASSERT_TRUE(chain.window.solve({}).converged());
  EXPECT_EQ(chain.window.refused_solves().count, 0);
  ASSERT_TRUE(chain.window.defer_to(std::make_unique<Lost>()).ok());
  ASSERT_TRUE(chain.window.begin_solve({}).ok());
  EXPECT_EQ(chain.window.finish_solve().reason, Reason::refused);
  EXPECT_FALSE(chain.window.begin_solve({}).ok());
  EXPECT_EQ(chain.window.refused_solves().count, 2);
  EXPECT_EQ(chain.window.refused_solves().first, "killed by signal 9 (Killed)");
}

}  // namespace
}  // namespace oriel
