// Threads that post while the owner solves. Under tsan these say that nothing but the box is shared.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "oriel/graph/fingerprint.h"
#include "oriel/graph/post_box.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

Pose3d pose_at(double x) { return Pose3d{}.plus(Vec6d{{0, 0, 0, x, 0, 0}}); }

// Poses in a row whose values are all wrong, so that each solve has something to do.
struct Row {
  Graph graph;
  std::vector<VariableId<Pose3d>> poses;
  explicit Row(int n) {
    GraphEdit edit = graph.edit();
    for (int i = 0; i < n; ++i) {
      poses.push_back(edit.add(Pose3d{}.plus(Vec6d{{0.3, -0.2, 0.1 * (i % 3), 0.5, 1.0 * (i % 5), 0}})));
      if (i > 0) edit.add(Between{pose_at(1.0)}, Sigma(0.1), poses[static_cast<std::size_t>(i) - 1], poses.back());
    }
    edit.add(Prior{Pose3d{}}, Sigma(0.1), poses[0]);
    EXPECT_TRUE(graph.apply(edit));
  }
};

// C3, C5
TEST(Posts, DuringASolveAreTakenAfterItAndNotOverwritten) {
  Row row(20);
  PostBox box;
  NativeEngine engine(row.graph);
  std::vector<Receipt> receipts;
  SolveOptions options;
  options.callback = [&](const IterationReport& r) {
    if (r.iteration != 1) return true;
    std::thread([&] {
      GraphEdit edit = GraphEdit::proposal();
      edit.set(row.poses[7], pose_at(123.0));
      edit.set(row.poses[9], pose_at(321.0));
      edit.fix(row.poses[9]);
      receipts.push_back(box.post(std::move(edit)));
    }).join();
    return true;
  };
  const Summary summary = engine.solve(options);
  ASSERT_TRUE(summary.converged()) << summary;
  ASSERT_EQ(receipts.size(), 1u);
  EXPECT_FALSE(receipts[0].done());
  EXPECT_NEAR(row.graph.value(row.poses[7]).translation()[0], 7.0, 1e-6);
  EXPECT_EQ(box.take(row.graph).applied, 1);
  EXPECT_EQ(row.graph.value(row.poses[7]).translation()[0], 123.0);
  EXPECT_EQ(row.graph.value(row.poses[9]).translation()[0], 321.0);
  const Summary again = engine.solve();
  EXPECT_TRUE(again.converged()) << again;
  EXPECT_EQ(row.graph.value(row.poses[9]).translation()[0], 321.0);  // fixed where the post has put it
}

// C3
TEST(Posts, OfManyThreadsAreNeverLost) {
  constexpr int kSenders = 3, kPosts = 60;
  Row row(30);
  PostBox box;
  std::atomic<int> running{kSenders};
  std::vector<std::vector<VariableId<Point3d>>> made(kSenders);
  auto send = [&](int sender) {
    VariableId<Point3d> last;
    for (int i = 0; i < kPosts; ++i) {
      GraphEdit edit = GraphEdit::proposal();
      const auto fresh = edit.add(Point3d{{{1.0 * sender, 1.0 * i, 0}}});
      edit.fix(fresh);  // so that no solve moves what is looked at below
      if (i > 0) edit.set(last, Point3d{{{1.0 * sender, 1.0 * i, 1.0}}});
      const Receipt receipt = box.post(std::move(edit), static_cast<std::uint32_t>(sender));
      ASSERT_TRUE(receipt.wait()) << receipt.wait().error();
      last = receipt.edit().resolved(fresh);
      made[static_cast<std::size_t>(sender)].push_back(last);
    }
    running.fetch_sub(1);
  };
  std::vector<std::thread> senders;
  for (int s = 0; s < kSenders; ++s) senders.emplace_back(send, s);
  NativeEngine engine(row.graph);
  SolveOptions options;
  options.max_iterations = 2;
  options.threads = 2;
  int applied = 0, solves = 0;
  for (bool more = true; more; ++solves) {
    more = running.load() > 0;
    EXPECT_FALSE(engine.solve(options).failed());
    const PostBox::Report report = box.take(row.graph);
    EXPECT_EQ(report.refused, 0);
    applied += report.applied;
  }
  for (std::thread& t : senders) t.join();
  EXPECT_EQ(applied, kSenders * kPosts);
  EXPECT_EQ(row.graph.count<Point3d>(), static_cast<std::size_t>(kSenders * kPosts));
  for (int s = 0; s < kSenders; ++s)
    for (int i = 0; i < kPosts; ++i) {
      const Point3d p = row.graph.value(made[static_cast<std::size_t>(s)][static_cast<std::size_t>(i)]);
      EXPECT_EQ(p.p[1], i + 1 < kPosts ? i + 1.0 : i);
    }
  EXPECT_GE(solves, kPosts);  // each sender waits for its receipt
}

// The fingerprint after each round of a run whose senders are threads, or one after the other.
std::vector<std::uint64_t> run_by_stamps(bool threads) {
  constexpr std::uint32_t kSenders = 3;
  constexpr std::uint64_t kRounds = 12;
  Row row(15);
  PostBox box;
  std::atomic<std::uint64_t> sent[kSenders] = {};
  auto send = [&](std::uint32_t sender, std::uint64_t from, std::uint64_t to) {
    for (std::uint64_t stamp = from; stamp <= to; ++stamp) {
      for (int k = 0; k < 3; ++k) {
        GraphEdit edit = GraphEdit::proposal();
        const double x = static_cast<double>(stamp) + 0.1 * sender + 0.01 * k;
        edit.add(Prior{pose_at(x)}, Sigma(0.5), edit.add(pose_at(x + 1.0)));
        edit.set(row.poses[stamp % row.poses.size()], pose_at(x));
        box.post(std::move(edit), sender, stamp);
      }
      sent[sender].store(stamp, std::memory_order_release);
      sent[sender].notify_all();
    }
  };
  std::vector<std::thread> senders;
  for (std::uint32_t s = 0; threads && s < kSenders; ++s) senders.emplace_back(send, s, 1, kRounds);
  NativeEngine engine(row.graph);
  SolveOptions options;
  options.max_iterations = 2;
  std::vector<std::uint64_t> out;
  for (std::uint64_t round = 1; round <= kRounds; ++round) {
    for (std::uint32_t s = 0; s < kSenders; ++s) {
      if (!threads) send(kSenders - 1 - s, round, round);
      for (std::uint64_t n = sent[s].load(); threads && n < round; n = sent[s].load()) sent[s].wait(n);
    }
    EXPECT_EQ(box.take(row.graph, round).applied, 9);
    EXPECT_FALSE(engine.solve(options).failed());
    out.push_back(fingerprint(row.graph));
  }
  for (std::thread& t : senders) t.join();
  return out;
}

// C3, L10
TEST(Posts, ThatAreTakenByTheirStampsGiveTheSameBitsWhateverTheThreadsDo) {
  const auto expected = run_by_stamps(false);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(run_by_stamps(true), expected);
}

}  // namespace
}  // namespace oriel
