// Edits that other threads post, and that the owner takes: order, errors, ids.
#include "oriel/graph/post_box.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <thread>

#include "graph/chain.h"
#include "oriel/graph/fingerprint.h"

namespace oriel {
namespace {

using testing::Chain;
using testing::pose_at;

// C3
TEST(PostBox, AppliesByStampsAndSendersWhateverCameFirst) {
  struct Planned {
    std::uint32_t sender;
    std::uint64_t stamp;
    double x;
  };
  std::vector<Planned> plan;
  for (int i = 0; i < 12; ++i)
    plan.push_back({static_cast<std::uint32_t>(i % 3), static_cast<std::uint64_t>(i / 5), 1.0 * i});
  std::mt19937 random(3);
  std::uint64_t expected = 0;
  for (int round = 0; round < 20; ++round) {
    // Each sender keeps its own order; which of them comes first is chance.
    std::vector<std::size_t> next(3, 0);
    std::vector<std::vector<Planned>> of(3);
    for (const Planned& p : plan) of[p.sender].push_back(p);
    Chain g;
    PostBox box;
    for (std::size_t left = plan.size(); left > 0;) {
      const std::size_t s = random() % 3;
      if (next[s] == of[s].size()) continue;
      const Planned& p = of[s][next[s]++];
      GraphEdit edit = GraphEdit::proposal();
      edit.add(pose_at(p.x));
      edit.set(g.b, pose_at(p.x));  // the last one stands
      box.post(std::move(edit), p.sender, p.stamp);
      --left;
    }
    const PostBox::Report report = box.take(g.graph);
    EXPECT_EQ(report.applied, 12);
    EXPECT_EQ(report.refused, 0);
    EXPECT_EQ(g.graph.value(g.b).translation()[0], 11.0);  // of stamp 2 and sender 2
    if (round == 0) expected = fingerprint(g.graph);
    EXPECT_EQ(fingerprint(g.graph), expected) << round;
  }
}

TEST(PostBox, LeavesWhatIsStampedLaterWaiting) {
  Chain g;
  PostBox box;
  std::vector<Receipt> receipts;
  for (const std::uint64_t stamp : {30, 10, 20}) {
    GraphEdit edit = GraphEdit::proposal();
    edit.set(g.b, pose_at(1.0 * static_cast<double>(stamp)));
    receipts.push_back(box.post(std::move(edit), 0, stamp));
  }
  PostBox::Report report = box.take(g.graph, 20);
  EXPECT_EQ(report.applied, 2);
  EXPECT_EQ(report.waiting, 1);
  EXPECT_EQ(g.graph.value(g.b).translation()[0], 20.0);
  EXPECT_FALSE(receipts[0].done());
  EXPECT_TRUE(receipts[1].done() && receipts[2].done());
  report = box.take(g.graph);
  EXPECT_EQ(report.applied, 1);
  EXPECT_EQ(report.waiting, 0);
  EXPECT_EQ(g.graph.value(g.b).translation()[0], 30.0);
}

TEST(PostBox, TellsTheSenderWhyAPostWasRefusedAndTakesTheOthers) {
  Chain g;
  PostBox box;
  GraphEdit remove = GraphEdit::proposal();
  remove.remove(g.c);
  GraphEdit late = GraphEdit::proposal();  // its variable is gone by then
  late.set(g.c, pose_at(5.0));
  late.set(g.b, pose_at(6.0));
  GraphEdit good = GraphEdit::proposal();
  good.set(g.b, pose_at(7.0));
  const Receipt a = box.post(std::move(remove)), b = box.post(std::move(late)), c = box.post(std::move(good));
  const PostBox::Report report = box.take(g.graph);
  EXPECT_EQ(report.applied, 2);
  EXPECT_EQ(report.refused, 1);
  EXPECT_TRUE(a.wait());
  EXPECT_TRUE(c.wait());
  ASSERT_FALSE(b.wait());
  EXPECT_EQ(b.wait().error().code, ErrorCode::stale_id);
  EXPECT_NE(b.wait().error().message.find("set: "), std::string::npos) << b.wait().error();
  EXPECT_EQ(g.graph.value(g.b).translation()[0], 7.0);
}

TEST(PostBox, TellsTheSenderTheIdsOfWhatItAdded) {
  Chain g;
  PostBox box;
  GraphEdit edit = GraphEdit::proposal();
  const auto pose = edit.add(pose_at(3.0));
  const FactorId between = edit.add(Between{pose_at(1.0)}, Sigma(0.1), g.c, pose);
  const Receipt receipt = box.post(std::move(edit));
  box.take(g.graph);
  ASSERT_TRUE(receipt.wait());
  EXPECT_EQ(g.graph.value(receipt.edit().resolved(pose)).translation()[0], 3.0);
  EXPECT_TRUE(g.graph.contains(receipt.edit().resolved(between)));
}

// C6: what is fixed, removed or given a loss is looked up by the owner; the sender needs no graph.
TEST(PostBox, FixesRemovesAndWeighsWithoutTheSendersLookAtTheGraph) {
  Chain g;
  PostBox box;
  std::thread sender([&, b = g.b, c = g.c, prior = g.prior_a] {
    GraphEdit edit = GraphEdit::proposal();
    edit.fix(b);
    edit.remove(c);
    edit.set(prior, Huber(2.0));
    box.post(std::move(edit));
    GraphEdit release = GraphEdit::proposal();
    release.fix(b, false);
    release.remove(prior);
    box.post(std::move(release), 0, 1);
  });
  sender.join();
  PostBox::Report report = box.take(g.graph, 0);
  EXPECT_EQ(report.applied, 1);
  EXPECT_TRUE(g.graph.fixed(g.b));
  EXPECT_FALSE(g.graph.contains(g.c));
  ASSERT_TRUE(g.graph.contains(g.prior_a));
  bool weighed = false;
  for (const auto& t : g.graph.tables())
    if (t->ops().key == g.prior_a.table) weighed = t->loss(t->slots().find(g.prior_a.key)).scale == 2.0;
  EXPECT_TRUE(weighed);
  report = box.take(g.graph);
  EXPECT_EQ(report.applied, 1);
  EXPECT_FALSE(g.graph.fixed(g.b));
  EXPECT_FALSE(g.graph.contains(g.prior_a));
}

TEST(PostBox, RefusesWhatIsOfATypeThatTheGraphDoesNotKnow) {
  Graph graph;
  PostBox box;
  GraphEdit edit = GraphEdit::proposal();
  edit.fix(VariableKey(type_key("test.nowhere/1"), SlotKey{0, 1}));
  const Receipt receipt = box.post(std::move(edit));
  EXPECT_EQ(box.take(graph).refused, 1);
  ASSERT_FALSE(receipt.wait());
  EXPECT_EQ(receipt.wait().error().code, ErrorCode::stale_id);
}

TEST(PostBox, RefusesAnEditWhoseIdsAGraphHasLent) {
  Chain g;
  PostBox box;
  GraphEdit edit = g.graph.edit();
  edit.set(g.b, pose_at(9.0));
  const Receipt receipt = box.post(std::move(edit));
  ASSERT_TRUE(receipt.done());
  EXPECT_EQ(receipt.wait().error().code, ErrorCode::conflict);
  EXPECT_EQ(box.take(g.graph).applied, 0);
}

TEST(PostBox, AnswersWhoeverWaitsWhenItIsClosed) {
  Chain g;
  auto box = std::make_unique<PostBox>();
  auto post = [&g, &box] {
    GraphEdit edit = GraphEdit::proposal();
    edit.set(g.b, pose_at(9.0));
    return box->post(std::move(edit));
  };
  const Receipt waiting = post();
  std::thread sender([waiting] { EXPECT_FALSE(waiting.wait()); });
  box->close();
  EXPECT_FALSE(post().wait());
  EXPECT_EQ(box->take(g.graph).applied, 0);
  sender.join();
  box = std::make_unique<PostBox>();
  const Receipt left = post();
  box.reset();
  EXPECT_FALSE(left.wait());
}

}  // namespace
}  // namespace oriel
