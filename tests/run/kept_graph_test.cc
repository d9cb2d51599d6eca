#include "oriel/run/kept_graph.h"

#include <gtest/gtest.h>

#include "graph/random_graph.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

// R6: what another worker is told is the graph that the first one has, after any number of edits and solves, whether
// the whole was taken anew in between or not.
TEST(KeptGraph, TellsTheGraphThatWasToldAndSolved) {
  const TypeList types = testing_graph::random_graph_types();
  for (unsigned seed = 1; seed <= 8; ++seed) {
    testing_graph::RandomGraph origin(seed, true);
    const Subscription subscription = origin.graph.subscribe();
    run_detail::KeptGraph kept(seed % 2 == 0 ? std::size_t{1} << 30 : 2000);
    Graph worker;
    NativeEngine engine(worker);
    GraphEdit edit;
    std::mt19937 random(seed);
    Bytes message, told;
    EXPECT_FALSE(kept.tell(types, told));
    int solved = 0;
    for (int job = 0; job < 60; ++job) {
      ASSERT_TRUE(origin.step(6));
      origin.graph.collect(subscription, edit);
      if (job == 0) edit.mark_whole();
      message.clear();
      append_edit(message, edit);
      ASSERT_TRUE(worker.apply(edit));
      kept.told(message, job == 0, origin.graph);
      for (int tries = static_cast<int>(random() % 4) - 1; tries > 0; --tries) {
        ASSERT_TRUE(kept.tell(types, told));
        const auto read = read_message(told);
        ASSERT_TRUE(read);
        Graph another;
        GraphEdit all;
        ASSERT_TRUE(read_edit(*read, types, another, all));
        EXPECT_TRUE(all.whole());
        ASSERT_TRUE(another.apply(all));
        ASSERT_EQ(fingerprint(another), fingerprint(worker)) << seed << ' ' << job;
      }
      SolveOptions solve;
      solve.max_iterations = job % 3;
      const Summary summary = engine.solve(solve);
      if (summary.failed() || summary.accepted == 0) continue;
      ++solved;
      Bytes found;
      append_solution(found, engine.solution());
      kept.solved(found);
      Solution solution = engine.solution();
      solution.version = origin.graph.version();
      ASSERT_TRUE(origin.graph.adopt(solution));
    }
    EXPECT_GT(solved, 10);
    kept.forget();
    EXPECT_FALSE(kept.tell(types, told));
    kept.told(message, false, origin.graph);  // nothing that it could be on top of
    EXPECT_FALSE(kept.knows());
    origin.graph.unsubscribe(subscription);
  }
}

}  // namespace
}  // namespace oriel
