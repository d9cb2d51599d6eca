// A window whose solves go to another engine.
#include <gtest/gtest.h>

#include "oriel/engines/ceres/ceres_engine.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/window/window_core.h"

namespace oriel {
namespace {

using V = VectorNd<2>;

// x_0 known, and a chain of steps (1, 0.5) from it, three of which stay.
struct Chain {
  WindowCore window;
  std::vector<VariableId<V>> x;
  Summary grow() {
    GraphEdit& edit = window.edit();
    x.push_back(edit.add(V{}));
    if (x.size() == 1)
      edit.add(Prior{V{}}, Sigma(0.1), x[0]);
    else
      edit.add(Between{V{{{1.0, 0.5}}}}, Sigma(0.2), Cauchy(2.0), x[x.size() - 2], x.back());
    EXPECT_TRUE(window.commit());
    Summary summary = window.solve({});
    if (x.size() > 3) {
      const VariableKey oldest[] = {x[x.size() - 4]};
      EXPECT_TRUE(window.slide(oldest, {}));
    }
    return summary;
  }
};

struct Watcher final : WindowObserver {
  void edited() override {}
  void solved(const SolveOptions&, const SolverState&, const Summary&, const NativeEngine&) override { ++solves; }
  int solves = 0;
};

// C8
TEST(CeresWindow, IsSolvedByTheEngineThatItIsGivenAndSlidesAsBefore) {
  Chain native, ceres;
  ASSERT_TRUE(ceres.window.use(std::make_unique<CeresEngine>(ceres.window.followed())));
  for (int k = 0; k < 12; ++k) {
    const Summary a = native.grow(), b = ceres.grow();
    ASSERT_TRUE(a.converged()) << a;
    ASSERT_TRUE(b.converged()) << b;
    EXPECT_EQ(std::string(b.linear_solver), "ceres_sparse_cholesky");
    EXPECT_NE(std::string(a.linear_solver), "ceres_sparse_cholesky");
    EXPECT_LT((native.window.graph().value(native.x.back()).v - ceres.window.graph().value(ceres.x.back()).v).norm(),
              1e-6);
  }
  EXPECT_EQ(ceres.window.graph().count<V>(), 3u);
  EXPECT_EQ(ceres.window.graph().priors().slots().size(), 1u);
  ASSERT_TRUE(ceres.window.use(nullptr));
  EXPECT_NE(std::string(ceres.grow().linear_solver), "ceres_sparse_cholesky");
}

TEST(CeresWindow, IsNotGivenToAnotherEngineWhileAJournalWatches) {
  Chain chain;
  Watcher watcher;
  chain.window.observe(&watcher);
  const auto ok = chain.window.use(std::make_unique<CeresEngine>(chain.window.followed()));
  ASSERT_FALSE(ok.ok());
  EXPECT_EQ(ok.error().code, ErrorCode::conflict);
  EXPECT_NE(ok.error().text().find("the engine ceres cannot solve an observed window"), std::string::npos);
  (void)chain.grow();
  EXPECT_EQ(watcher.solves, 1);
  chain.window.observe(nullptr);
  EXPECT_TRUE(chain.window.use(std::make_unique<CeresEngine>(chain.window.followed())));
}

}  // namespace
}  // namespace oriel
