// A graph that is solved beside its owner has the bits of one that is solved in place, through edits that come
// meanwhile and workers that die.
#include "oriel/run/solve_beside.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <iostream>
#include <thread>

#include "graph/random_graph.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/residual/pose_graph.h"
#include "run/worker_of.h"

namespace oriel {
namespace {

struct RandomTypes {
  static constexpr const char* kName = "random";
  static TypeList types() { return testing_graph::random_graph_types(); }
};
using Beside = SolveBesideWith<RandomTypes>;
using Clock = std::chrono::steady_clock;

struct History {
  std::vector<std::uint64_t> fingerprints;
  int moved = 0, restarts = 0;
};

// Rounds of: submit, edits meanwhile, write back. `kills` of ten rounds lose their worker.
History run(ExecutorKind kind, Zygote& zygote, unsigned seed, int rounds, int kills) {
  testing_graph::RandomGraph origin(seed, true);
  std::mt19937 accidents(seed + 1);
  ExecutorOptions options;
  options.zygote = &zygote;
  auto beside = std::move(Beside::start(origin.graph, kind, options).value());
  History out;
  for (int round = 0; round < rounds; ++round) {
    EXPECT_TRUE(origin.step(8));
    SolveOptions solve;
    solve.max_iterations = 1 + round % 6;
    const JobReport begun = beside.submit(solve);
    EXPECT_EQ(begun.status, JobStatus::accepted) << begun;
    if (static_cast<int>(accidents() % 10) < kills) {
      std::this_thread::sleep_for(std::chrono::microseconds(accidents() % 300));
      if (const pid_t pid = worker_of(zygote); pid > 0) ::kill(pid, SIGKILL);
    }
    for (int edits = round % 3; edits > 0; --edits) EXPECT_TRUE(origin.step(6));
    const JobReport done = beside.write_back();
    EXPECT_EQ(done.status, JobStatus::done) << done;
    out.restarts += done.restarted;
    out.moved += beside.outcome().accepted > 0;
    out.fingerprints.push_back(fingerprint(origin.graph));
    EXPECT_EQ(beside.write_back().status, JobStatus::none);
  }
  return out;
}

// R1, R2
TEST(SolveBeside, HasTheSameBitsInAllExecutorsWhileItsOwnerGoesOnEditing) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    Zygote zygote = Zygote::start({&Beside::kTask}).value();
    const History in_place = run(ExecutorKind::in_place, zygote, seed, 40, 0);
    EXPECT_GT(in_place.moved, 10);
    EXPECT_EQ(run(ExecutorKind::thread, zygote, seed, 40, 0).fingerprints, in_place.fingerprints) << seed;
    EXPECT_EQ(run(ExecutorKind::process, zygote, seed, 40, 0).fingerprints, in_place.fingerprints) << seed;
  }
}

// R1: and those of an engine of the owner's.
// But for the times.
void expect_same(const Summary& a, const Summary& b) {
  EXPECT_EQ(a.reason_text(), b.reason_text());
  EXPECT_EQ(a.left_text(), b.left_text());
  EXPECT_EQ(a.refusal, b.refusal);
  EXPECT_STREQ(a.linear_solver, b.linear_solver);
  EXPECT_EQ(a.linearizations, b.linearizations);
  EXPECT_EQ(a.fresh_cost, b.fresh_cost);
  EXPECT_EQ(a.factors, b.factors);
  EXPECT_EQ(a.not_finite, b.not_finite);
  EXPECT_EQ(a.trace.size(), b.trace.size());
  const auto ids_of = [](const std::vector<UndeterminedDirection>& directions) {
    std::vector<std::pair<VariableKey, int>> ids;
    for (const auto& d : directions)
      for (const auto& s : d.scalars) ids.emplace_back(s.id, s.tangent);
    return ids;
  };
  EXPECT_EQ(ids_of(a.undetermined), ids_of(b.undetermined));
  EXPECT_EQ(ids_of(a.gauge), ids_of(b.gauge));
}

TEST(SolveBeside, HasTheBitsOfAnEngineThatSolvesTheGraphItself) {
  Zygote zygote = Zygote::start({&Beside::kTask}).value();
  for (const ExecutorKind kind : {ExecutorKind::in_place, ExecutorKind::process}) {
    testing_graph::RandomGraph a(9, true), b(9, true);
    NativeEngine engine(a.graph);
    ExecutorOptions options;
    options.zygote = &zygote;
    auto beside = std::move(Beside::start(b.graph, kind, options).value());
    for (int round = 0; round < 40; ++round) {
      ASSERT_TRUE(a.step(8));
      ASSERT_TRUE(b.step(8));
      SolveOptions solve;
      solve.max_iterations = 1 + round % 6;
      const Summary summary = engine.solve(solve);
      ASSERT_TRUE(beside.submit(solve));
      ASSERT_EQ(beside.write_back().status, JobStatus::done);
      EXPECT_EQ(beside.outcome().final_cost, summary.final_cost);
      expect_same(beside.summary(), summary);
      ASSERT_EQ(fingerprint(a.graph), fingerprint(b.graph)) << name_of(kind) << ' ' << round;
    }
  }
}

// R6: the child is started anew from the owner's graph, and its bits are those of the undisturbed run.
TEST(SolveBeside, ComesToTheBitsOfTheUndisturbedRunWhereWorkersDie) {
  for (unsigned seed = 11; seed <= 14; ++seed) {
    Zygote zygote = Zygote::start({&Beside::kTask}).value();
    const History calm = run(ExecutorKind::in_place, zygote, seed, 30, 0);
    const History stormy = run(ExecutorKind::process, zygote, seed, 30, 5);
    EXPECT_EQ(calm.fingerprints, stormy.fingerprints) << seed;
    EXPECT_GT(stormy.restarts, 0);
  }
}

// C5, R2: what the owner set or fixed while the solve was under way stays.
TEST(SolveBeside, DoesNotOverwriteWhatItsOwnerSetOrFixedMeanwhile) {
  Zygote zygote = Zygote::start({&SolveBeside::kTask}).value();
  for (const ExecutorKind kind : {ExecutorKind::in_place, ExecutorKind::process}) {
    Graph graph;
    GraphEdit edit = graph.edit();
    std::vector<VariableId<Point3d>> p;
    for (int i = 0; i < 3; ++i) {
      p.push_back(edit.add(Point3d{{{0.0, 0.0, 0.0}}}));
      edit.add(Prior<Point3d>{{{{1.0, 1.0, 1.0}}}}, Sigma(0.1), p.back());
    }
    ASSERT_TRUE(graph.apply(edit));
    ExecutorOptions options;
    options.zygote = &zygote;
    auto beside = std::move(SolveBeside::start(graph, kind, options).value());
    beside.want_fingerprints();
    ASSERT_TRUE(beside.submit({}));
    GraphEdit meanwhile = graph.edit();
    meanwhile.set(p[0], Point3d{{{5.0, 5.0, 5.0}}});
    meanwhile.fix(p[1]);
    ASSERT_TRUE(graph.apply(meanwhile));
    ASSERT_EQ(beside.write_back().status, JobStatus::done);
    EXPECT_EQ(graph.value(p[0]).p[0], 5.0);
    EXPECT_EQ(graph.value(p[1]).p[0], 0.0);
    EXPECT_NEAR(graph.value(p[2]).p[0], 1.0, 1e-6);
    ASSERT_TRUE(beside.submit({}));  // and the worker knows
    ASSERT_EQ(beside.write_back().status, JobStatus::done);
    EXPECT_NEAR(graph.value(p[0]).p[0], 1.0, 1e-6);
    EXPECT_EQ(graph.value(p[1]).p[0], 0.0);
    EXPECT_EQ(beside.outcome().fingerprint, fingerprint(graph)) << name_of(kind);
  }
}

// C5, R2: held or fixed meanwhile, and let go again before the worker hears of it: it has to hear of the value.
TEST(SolveBeside, AgreesOnWhatWasHeldForTheTimeOfASolve) {
  Zygote zygote = Zygote::start({&SolveBeside::kTask}).value();
  for (const bool released : {false, true}) {
    Graph graph;
    GraphEdit edit = graph.edit();
    std::vector<VariableId<Point3d>> p;
    for (int i = 0; i < 3; ++i) {
      p.push_back(edit.add(Point3d{}));
      edit.add(Prior<Point3d>{{{{1.0, 1.0, 1.0}}}}, Sigma(0.1), p.back());
    }
    ASSERT_TRUE(graph.apply(edit));
    ExecutorOptions options;
    options.zygote = &zygote;
    auto beside = std::move(SolveBeside::start(graph, ExecutorKind::process, options).value());
    beside.want_fingerprints();
    ASSERT_TRUE(beside.submit({}));
    edit.clear();
    edit.fix(p[0]);
    edit.set(p[1], Freedom::hold({2}));
    ASSERT_TRUE(graph.apply(edit));
    ASSERT_EQ(beside.write_back().status, JobStatus::done);
    EXPECT_EQ(graph.value(p[0]).p[2], 0.0);
    EXPECT_EQ(graph.value(p[1]).p[2], 0.0);  // the solve knew nothing of it
    EXPECT_NEAR(graph.value(p[2]).p[2], 1.0, 1e-6);
    edit.clear();
    edit.fix(p[0], !released);
    if (released) edit.set(p[1], Freedom::full());
    ASSERT_TRUE(graph.apply(edit));
    SolveOptions none;
    none.max_iterations = 0;
    ASSERT_TRUE(beside.submit(none));
    ASSERT_EQ(beside.write_back().status, JobStatus::done);
    EXPECT_EQ(beside.outcome().fingerprint, fingerprint(graph)) << released;
    ASSERT_TRUE(beside.submit({}));
    ASSERT_EQ(beside.write_back().status, JobStatus::done);
    EXPECT_EQ(beside.outcome().fingerprint, fingerprint(graph)) << released;
    EXPECT_NEAR(graph.value(p[1]).p[0], 1.0, 1e-6);
    EXPECT_NEAR(graph.value(p[1]).p[2], released ? 1.0 : 0.0, 1e-6);
  }
}

// C5, R2: no edit tells a worker of what another engine adopts; its next job has the graph as it is all the same.
TEST(SolveBeside, BeginsFromWhatAnEngineOfItsOwnersFoundBeforeAndMeanwhile) {
  Zygote zygote = Zygote::start({&Beside::kTask}).value();
  for (const ExecutorKind kind : {ExecutorKind::in_place, ExecutorKind::thread, ExecutorKind::process})
    for (const bool meanwhile : {false, true}) {
      testing_graph::RandomGraph origin(21, true);
      ExecutorOptions options;
      options.zygote = &zygote;
      auto beside = std::move(Beside::start(origin.graph, kind, options).value());
      beside.want_fingerprints();
      NativeEngine engine(origin.graph);
      SolveOptions once, none;
      once.max_iterations = 1, none.max_iterations = 0;
      int moved = 0;
      for (int round = 0; round < 20; ++round) {
        const std::string where = std::string(name_of(kind)) + ' ' + std::to_string(round);
        ASSERT_TRUE(origin.step(8));
        ASSERT_TRUE(beside.submit(once));
        if (meanwhile) moved += engine.solve({}).accepted > 0;
        ASSERT_EQ(beside.write_back().status, JobStatus::done) << where;
        if (!meanwhile) moved += engine.solve({}).accepted > 0;
        ASSERT_TRUE(beside.submit(none));
        ASSERT_EQ(beside.write_back().status, JobStatus::done) << where;
        ASSERT_EQ(beside.outcome().fingerprint, fingerprint(origin.graph)) << where;
      }
      EXPECT_GT(moved, 5);
    }
}

// The same, seen from what is sent: edits alone, whose numbers go on, but where something else was adopted.
TEST(SolveBeside, SendsTheWholeGraphWhereAnotherEngineAdoptedAndEditsElsewhere) {
  testing_graph::RandomGraph origin(22, true);
  run_detail::SolveOwner owner(origin.graph, RandomTypes::types(), true);
  run_detail::SolveContext worker(RandomTypes::types());
  NativeEngine engine(origin.graph);
  SolveOptions once;
  once.max_iterations = 1;
  enum class Others { none, before, meanwhile };
  int adopted = 0, adopted_by_others = 0;
  std::uint64_t expected = 1;
  for (int round = 0; round < 60; ++round) {
    const Others others = round % 7 == 3 ? Others::before : round % 7 == 6 ? Others::meanwhile : Others::none;
    ASSERT_TRUE(origin.step(6));
    const std::uint64_t known = origin.graph.adoptions();
    if (others == Others::before) {
      EXPECT_FALSE(engine.solve({}).failed());
    }
    if (origin.graph.adoptions() != known) expected = 1, ++adopted_by_others;
    const SolveInput& input = owner.collect(once);
    EXPECT_EQ(input.sequence, expected) << round;
    owner.submitted();
    const auto output = worker.solve(input);
    ASSERT_TRUE(output.ok()) << output.error().text();
    const std::uint64_t sent = origin.graph.adoptions();
    if (others == Others::meanwhile) {
      EXPECT_FALSE(engine.solve({}).failed());
    }
    const bool moved = origin.graph.adoptions() != sent;
    adopted_by_others += moved;
    owner.write(*output);
    ASSERT_TRUE(owner.written().ok());
    adopted += owner.outcome().accepted > 0;
    expected = moved ? 1 : expected + 1;
  }
  EXPECT_GT(adopted, 20);
  EXPECT_GT(adopted_by_others, 5);
}

// R6: the elimination order of a large graph is state. A job that took the whole graph because its worker had fallen
// behind begins again, where that dies, with the order that it had.
TEST(SolveBeside, BeginsAgainWithTheOrderThatTheJobHad) {
  constexpr int kPoses = 20'100;  // FactorOptions::least_followed and some
  Zygote zygote = Zygote::start({&SolveBeside::kTask}).value();
  std::vector<std::uint64_t> calm;
  for (const ExecutorKind kind : {ExecutorKind::in_place, ExecutorKind::process}) {
    Graph graph;
    graph.bound_log({.per_live = 0.0, .least = 4});  // whoever follows falls behind by what is set below
    std::mt19937 random(5);
    std::normal_distribution<double> noise(0.0, 0.05);
    std::vector<VariableId<Pose2d>> poses;
    const auto pose_at = [&](int i) {
      return Pose2d{}.plus({{noise(random), 1.0 * i + noise(random), noise(random)}});
    };
    const auto grow = [&](int count) {
      GraphEdit edit = graph.edit();
      const auto join = [&](std::size_t a, std::size_t b) {
        const Pose2d measured = Pose2d{}.plus({{noise(random), static_cast<double>(b - a), noise(random)}});
        edit.add(PoseGraphEdge2d{measured}, Sigma(0.1), poses[a], poses[b]);
      };
      for (int k = 0; k < count; ++k) {
        poses.push_back(edit.add(pose_at(static_cast<int>(poses.size()))));
        const std::size_t i = poses.size() - 1;
        if (i == 0) edit.fix(poses[0]);
        if (i > 0) join(i - 1, i);
        if (i > kPoses) edit.set(poses[i - kPoses], pose_at(static_cast<int>(i) - kPoses));
        if (i > 200 && i % 7 == 0) join(i - 1 - random() % 150, i);
      }
      return graph.apply(edit).ok();
    };
    ExecutorOptions options;
    options.zygote = &zygote;
    auto beside = std::move(SolveBeside::start(graph, kind, options).value());
    SolveOptions once;
    once.max_iterations = 1;
    for (int round = 0; round < 3; ++round) {
      ASSERT_TRUE(grow(round == 0 ? kPoses : 40));
      ASSERT_EQ(beside.submit(once).status, JobStatus::accepted);
      if (const pid_t pid = worker_of(zygote); pid > 0 && round > 0) ::kill(pid, SIGKILL);
      const JobReport done = beside.write_back();
      ASSERT_EQ(done.status, JobStatus::done) << done;
      EXPECT_GT(beside.outcome().accepted, 0);
      if (kind == ExecutorKind::in_place) {
        calm.push_back(value_fingerprint(graph));
        continue;
      }
      EXPECT_EQ(value_fingerprint(graph), calm[static_cast<std::size_t>(round)]) << round;
      EXPECT_EQ(done.restarted, round > 0);
    }
  }
}

// Draws a point to x = 3, and once takes its time for it.
struct Slow {
  static constexpr std::string_view kName = "test.slow/1";
  using Variables = Types<Point3d>;
  static inline std::atomic<int> milliseconds{0};
  double x;
  template <class S>
  Vec<S, 1> operator()(const Point3<S>& p) const {
    if (const int ms = milliseconds.exchange(0); ms > 0) std::this_thread::sleep_for(std::chrono::milliseconds(ms));
    return {{p.p[0] - S(x)}};
  }
};
struct SlowTypes {
  static constexpr const char* kName = "slow";
  static TypeList types() { return TypeList().factor<Slow, IsotropicNoise>(); }
};

// R3: a thread that is still at a job that was given up refuses the next one; what was collected for that is not lost.
TEST(SolveBeside, LosesNothingToAWorkerThatIsBusy) {
  Graph graph;
  GraphEdit edit = graph.edit();
  std::vector<VariableId<Point3d>> p;
  const auto add_point = [&] {
    p.push_back(edit.add(Point3d{}));
    edit.add(Slow{3.0}, Sigma(1.0), p.back());
    ASSERT_TRUE(graph.apply(edit));
    edit.clear();
  };
  add_point();
  ExecutorOptions options;
  options.time_limit = Duration::from_seconds(0.3);
  auto beside = std::move(SolveBesideWith<SlowTypes>::start(graph, ExecutorKind::thread, options).value());
  Slow::milliseconds = 900;
  ASSERT_TRUE(beside.submit({}));
  EXPECT_EQ(beside.write_back().status, JobStatus::timed_out);
  add_point();
  int refused = 0;
  while (beside.submit({}).status == JobStatus::busy) {
    ++refused;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_GT(refused, 0);
  EXPECT_EQ(beside.write_back().status, JobStatus::done);
  EXPECT_NEAR(graph.value(p[0]).p[0], 3.0, 1e-6);
  EXPECT_NEAR(graph.value(p[1]).p[0], 3.0, 1e-6);
}

TEST(SolveBeside, SaysThatItIsBusyAndWhatAFailedJobWasAbout) {
  Zygote zygote = Zygote::start({&SolveBeside::kTask}).value();
  testing_graph::RandomGraph origin(3);  // of types that the worker does not know
  ASSERT_TRUE(origin.step(30));
  ExecutorOptions options;
  options.zygote = &zygote;
  auto beside = std::move(SolveBeside::start(origin.graph, ExecutorKind::process, options).value());
  ASSERT_TRUE(beside.submit({}));
  EXPECT_EQ(beside.submit({}).status, JobStatus::busy);
  const std::uint64_t before = fingerprint(origin.graph);
  const JobReport failed = beside.write_back();
  EXPECT_EQ(failed.status, JobStatus::failed) << failed;
  EXPECT_NE(failed.message.find("test.seen_point"), std::string::npos) << failed;
  EXPECT_EQ(fingerprint(origin.graph), before);
}

}  // namespace
}  // namespace oriel
