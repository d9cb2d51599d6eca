// check(engine, graph) of both engines, on the same random edits.
#include <gtest/gtest.h>

#include "graph/random_graph.h"
#include "oriel/engines/ceres/ceres_engine.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

// C7
TEST(CheckEngine, FindsNothingForEitherEngineAfterEachStepOfRandomEditsAndSolves) {
  for (unsigned seed = 11; seed <= 13; ++seed) {
    testing_graph::RandomGraph random(seed, true);
    NativeEngine native(random.graph);
    CeresEngine ceres(random.graph);
    for (int round = 0; round < 60; ++round) {
      ASSERT_TRUE(random.step(8));
      if (round % 12 == 7) {
        ASSERT_FALSE(ceres.solve({.max_iterations = 2}).failed());
      }
      for (Engine* engine : {static_cast<Engine*>(&native), static_cast<Engine*>(&ceres)}) {
        const auto ok = check(*engine, random.graph);
        ASSERT_TRUE(ok) << engine->name() << ", seed " << seed << ", round " << round << ": " << ok.error();
      }
    }
  }
}

}  // namespace
}  // namespace oriel
