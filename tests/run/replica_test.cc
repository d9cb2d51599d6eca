// A replica in a process of its own comes to the same bits.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <csignal>
#include <thread>

#include "graph/random_graph.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/run/replica.h"

namespace oriel {
namespace {

using testing_graph::random_graph_types;
using testing_graph::RandomGraph;

// An origin that edits at random, solves now and then, and its replica.
class Pair {
 public:
  Pair(unsigned seed, Replica& replica)
      : origin_(seed), engine_(origin_.graph), replica_(replica), subscription_(origin_.graph.subscribe()) {}

  // Edits, told at a pace of their own, and then a solve on both sides.
  void round() {
    for (int edits = 1 + origin_.below(4); edits > 0; --edits) {
      ASSERT_TRUE(origin_.step(8));
      ASSERT_TRUE(origin_.below(3) > 0 || replica_.follow(origin_.graph, subscription_));
    }
    ASSERT_TRUE(replica_.follow(origin_.graph, subscription_));
    if (origin_.below(3) == 0) engine_.drop_caches();
    ASSERT_TRUE(origin_.below(3) > 0 || replica_.drop_caches());
    SolveOptions options;
    options.max_iterations = 1 + origin_.below(8);
    options.method = origin_.below(4) == 0 ? Method::gauss_newton : Method::levenberg_marquardt;
    options.threads = 1 + origin_.below(2);
    const SolverState before = engine_.state();
    const Summary summary = engine_.solve(options);
    SolveRequest request = request_of(options, before, summary);
    request.options.threads = 1 + origin_.below(2);
    ASSERT_TRUE(replica_.solve(request));
    expected_.push_back(outcome_of(summary, engine_.state(), origin_.graph));
    moved_ += summary.accepted > 0;
  }
  // Takes the replica's answers, late and in order.
  void compare() {
    for (std::size_t i = 0; i < expected_.size(); ++i) {
      const auto got = replica_.outcome();
      ASSERT_TRUE(got) << got.error();
      EXPECT_EQ(got->fingerprint, expected_[i].fingerprint) << "solve " << i;
      EXPECT_EQ(got->reason, expected_[i].reason);
      EXPECT_EQ(got->iterations, expected_[i].iterations);
      EXPECT_EQ(got->initial_cost, expected_[i].initial_cost);
      EXPECT_EQ(got->final_cost, expected_[i].final_cost);
      EXPECT_EQ(got->state.lambda, expected_[i].state.lambda);
    }
    expected_.clear();
  }
  int moved() const { return moved_; }

 private:
  RandomGraph origin_;
  NativeEngine engine_;
  Replica& replica_;
  Subscription subscription_;
  std::vector<SolveOutcome> expected_;
  int moved_ = 0;
};

// R1, L10
TEST(Replica, ComesToTheSameBitsOnARandomlyChangingGraph) {
  const TypeList types = random_graph_types();
  for (unsigned seed = 1; seed <= 8; ++seed) {
    auto replica = Replica::start(types);
    ASSERT_TRUE(replica) << replica.error();
    Pair pair(seed, *replica);
    for (int round = 0; round < 60; ++round) {
      pair.round();
      if (round % 7 == 6) pair.compare();
      if (HasFailure()) FAIL() << "seed " << seed << ", round " << round;
    }
    pair.compare();
    EXPECT_GT(pair.moved(), 30) << "the solves did nothing";
  }
}

// R1: one that joins late is sent the graph as it is.
TEST(Replica, ThatJoinsLateComesToTheSameBits) {
  auto replica = Replica::start(random_graph_types());
  ASSERT_TRUE(replica) << replica.error();
  RandomGraph origin(21, true);
  NativeEngine engine(origin.graph);
  SolveOptions options;
  options.max_iterations = 3;
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(origin.step(8));
    static_cast<void>(engine.solve(options));
  }
  const Subscription s = origin.graph.subscribe();
  ASSERT_TRUE(replica->follow(origin.graph, s));
  const SolverState before = engine.state();
  const Summary summary = engine.solve(options);
  ASSERT_TRUE(replica->solve(request_of(options, before, summary)));
  const auto got = replica->outcome();
  ASSERT_TRUE(got) << got.error();
  EXPECT_EQ(got->fingerprint, fingerprint(origin.graph));
}

// R1: a solution that is sent gives the values without a solve.
TEST(Replica, HasTheOriginsBitsAfterItsSolution) {
  auto replica = Replica::start(random_graph_types());
  ASSERT_TRUE(replica) << replica.error();
  RandomGraph origin(22, true);
  NativeEngine engine(origin.graph);
  const Subscription s = origin.graph.subscribe();
  for (int i = 0; i < 30; ++i) {
    ASSERT_TRUE(origin.step(8));
    ASSERT_TRUE(replica->follow(origin.graph, s));
    SolveOptions options;
    options.max_iterations = 2;
    const Summary summary = engine.solve(options);
    if (summary.accepted > 0)
      ASSERT_TRUE(replica->adopt(engine.solution()));
    else
      ASSERT_TRUE(replica->look());
    const auto got = replica->outcome();
    ASSERT_TRUE(got) << got.error();
    ASSERT_EQ(got->fingerprint, fingerprint(origin.graph)) << "round " << i;
  }
}

// R1, C1: one that fell too far behind begins anew with the whole graph, under the engine that it has.
TEST(Replica, HasTheOriginsBitsAfterItFellBehind) {
  auto replica = Replica::start(random_graph_types());
  ASSERT_TRUE(replica) << replica.error();
  RandomGraph origin(24, true);
  origin.graph.bound_log({.per_live = 0.1, .least = 4});
  NativeEngine engine(origin.graph);
  const Subscription s = origin.graph.subscribe();
  int behind = 0;
  for (int i = 0; i < 60; ++i) {
    for (int edits = 1 + origin.below(6); edits > 0; --edits) ASSERT_TRUE(origin.step(8));
    behind += origin.graph.log().behind(s);
    ASSERT_TRUE(replica->follow(origin.graph, s));
    SolveOptions options;
    options.max_iterations = 3;
    const SolverState before = engine.state();
    const Summary summary = engine.solve(options);
    ASSERT_TRUE(replica->solve(request_of(options, before, summary)));
    const auto got = replica->outcome();
    ASSERT_TRUE(got) << got.error();
    ASSERT_EQ(got->fingerprint, fingerprint(origin.graph)) << "round " << i;
  }
  EXPECT_GT(behind, 10);
  EXPECT_LT(behind, 60);
}

// A deadline or a callback ends a solve at a step that the request names.
TEST(Replica, FollowsASolveThatWasStoppedFromOutside) {
  auto replica = Replica::start(random_graph_types());
  ASSERT_TRUE(replica) << replica.error();
  RandomGraph origin(23, true);
  NativeEngine engine(origin.graph);
  const Subscription s = origin.graph.subscribe();
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(origin.step(8));
  ASSERT_TRUE(replica->follow(origin.graph, s));
  SolveOptions options;
  options.callback = [](const IterationReport& r) { return r.iteration < 2; };
  const SolverState before = engine.state();
  const Summary summary = engine.solve(options);
  ASSERT_EQ(summary.reason, Reason::stopped_by_callback);
  ASSERT_TRUE(replica->solve(request_of(options, before, summary)));
  const auto got = replica->outcome();
  ASSERT_TRUE(got) << got.error();
  EXPECT_EQ(got->fingerprint, fingerprint(origin.graph));
}

TEST(Replica, AnswersAnEditThatItCannotApplyWithTheReason) {
  TypeList few;
  few.variable<Point3d>();
  auto replica = Replica::start(few);
  ASSERT_TRUE(replica) << replica.error();
  Graph origin;
  GraphEdit edit = origin.edit();
  edit.add(Pose3d{});
  ASSERT_TRUE(replica->send(edit));
  const auto got = replica->outcome();
  ASSERT_FALSE(got);
  EXPECT_EQ(got.error().code, ErrorCode::not_found);
  EXPECT_NE(got.error().message.find("pose3/1"), std::string::npos) << got.error();
}

TEST(Replica, ThatWasKilledIsAnError) {
  auto replica = Replica::start(random_graph_types());
  ASSERT_TRUE(replica) << replica.error();
  ASSERT_TRUE(replica->look());
  ASSERT_TRUE(replica->outcome());
  ASSERT_EQ(::kill(replica->pid(), SIGKILL), 0);
  EXPECT_FALSE(replica->look() && replica->outcome());
  RandomGraph origin(3, true);
  const Subscription s = origin.graph.subscribe();
  ASSERT_TRUE(origin.step(8));
  EXPECT_FALSE(replica->follow(origin.graph, s) && replica->outcome());
}

TEST(Replica, EndsWithItsOwner) {
  pid_t pid = -1;
  {
    auto replica = Replica::start(random_graph_types());
    ASSERT_TRUE(replica) << replica.error();
    pid = replica->pid();
    EXPECT_EQ(::kill(pid, 0), 0);
  }
  EXPECT_NE(::kill(pid, 0), 0);  // ended, and its end was taken note of
}

TEST(Replica, IsRefusedOnceThereAreThreads) {
  bool ready = false;
  std::thread other([&ready] {
    while (!__atomic_load_n(&ready, __ATOMIC_ACQUIRE)) std::this_thread::yield();
  });
  const auto replica = Replica::start(random_graph_types());
  __atomic_store_n(&ready, true, __ATOMIC_RELEASE);
  other.join();
#ifndef __SANITIZE_THREAD__
  ASSERT_FALSE(replica);
  EXPECT_EQ(replica.error().code, ErrorCode::conflict);
#endif
}

// Two sides that send without taking anything in never wait for each other.
TEST(Channel, TakesInWhileItSends) {
  auto ends = Channel::make_pair();
  ASSERT_TRUE(ends);
  auto talk = [](Channel& c, std::uint8_t mark) {
    Bytes out;
    append_message(out, 77, [&](ByteWriter& w) {
      for (int i = 0; i < 3000000; ++i) w.put(mark);
    });
    ASSERT_TRUE(c.send(out));
    const auto got = c.receive();
    ASSERT_TRUE(got) << got.error();
    EXPECT_EQ(got->kind, 77);
    EXPECT_EQ(got->payload.size(), 3000000u);
  };
  std::thread other([&] { talk(ends->second, 2); });
  talk(ends->first, 1);
  other.join();
}

}  // namespace
}  // namespace oriel
