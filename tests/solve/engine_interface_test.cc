// What every engine says of itself, and that none does another thing than it was asked for.
#include <gtest/gtest.h>

#include <memory>

#include "graph/chain.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

using testing::Chain;
using testing::pose_at;

// Only what it must.
class Bare final : public Engine {
 public:
  explicit Bare(Graph& graph) : graph_(&graph) {}
  std::string_view name() const override { return "bare"; }
  EngineCapabilities capabilities() const noexcept override { return can; }
  Result<void> sync() noexcept override { return {}; }
  using Engine::solve;
  Summary solve(const SolveOptions& options) noexcept override {
    if (auto ok = can_solve(*this, *graph_, options); !ok) return refused(options, ok.error());
    return {};
  }
  double cost() noexcept override { return 0.0; }
  Result<EngineContents> contents() noexcept override { return EngineContents{}; }
  EngineCapabilities can;

 private:
  Graph* graph_;
};

std::string refusal(Engine& engine, const SolveOptions& options) {
  const Summary summary = engine.solve(options);
  EXPECT_EQ(summary.failed(), summary.reason == Reason::refused);
  EXPECT_FALSE(summary.failed() && summary.converged());
  EXPECT_EQ(summary.method, summary.failed() ? options.method : Method::levenberg_marquardt);
  return summary.failed() ? summary.reason_text() : "";
}

TEST(EngineInterface, RefusesInOneLineWhatAnEngineHasNot) {
  Chain g;
  GraphEdit first = g.graph.edit();
  first.variables(&kVariableOps<Pose3d>).set.emplace_back(g.b.key, edit::SetKind::first_estimate);
  const Pose3d x = pose_at(1.0);
  first.variables(&kVariableOps<Pose3d>).set_values.push_back(&x);
  ASSERT_TRUE(g.graph.apply(first));
  const std::uint64_t before = fingerprint(g.graph);
  Bare bare(g.graph);
  EXPECT_EQ(refusal(bare, {}), "the engine bare has no Levenberg-Marquardt");
  EXPECT_EQ(refusal(bare, {.method = Method::gauss_newton}), "the engine bare has no Gauss-Newton");
  EXPECT_EQ(refusal(bare, {.method = Method::dogleg}), "the engine bare has no dogleg steps");
  bare.can.levenberg_marquardt = true;
  EXPECT_EQ(refusal(bare, {.linear_solver = LinearSolver::conjugate_gradient}),
            "the engine bare has no conjugate gradients");
  EXPECT_EQ(refusal(bare, {.deadline = Duration{1}}), "the engine bare has no deadlines");
  EXPECT_EQ(refusal(bare, {.ordering = OrderingMethod::minimum_degree}), "the engine bare has no choice of orderings");
  EXPECT_EQ(refusal(bare, {.callback = [](const IterationReport&) { return true; }}),
            "the engine bare has no callbacks");
  EXPECT_EQ(refusal(bare, {}), "the engine bare has no linear priors, and the graph holds one");
  bare.can.linear_priors = true;
  EXPECT_EQ(refusal(bare, {}), "the engine bare has no robust losses, and the graph holds one");
  bare.can.losses = true;
  EXPECT_EQ(refusal(bare, {}), "the engine bare has no first estimates, and the graph holds some");
  EXPECT_EQ(refusal(bare, {.first_estimates = false}), "");
  bare.can.first_estimates = true;
  EXPECT_EQ(refusal(bare, {.threads = 4}), "");
  EXPECT_EQ(bare.covariance(g.a).error().text(), "the engine bare has no covariances");
  EXPECT_EQ(fingerprint(g.graph), before);
}

TEST(EngineInterface, AsksForLossesOnlyWhereThereIsOne) {
  Chain g;
  GraphEdit edit = g.graph.edit();
  edit.remove(g.linear_b);
  edit.set(g.between_bc, Loss::none());  // it had one
  ASSERT_TRUE(g.graph.apply(edit));
  Bare bare(g.graph);
  bare.can.levenberg_marquardt = true;
  const SolveOptions plain{.first_estimates = false};
  EXPECT_EQ(refusal(bare, plain), "");
  GraphEdit robust = g.graph.edit();
  robust.set(g.between_ab, Huber(1.0));
  ASSERT_TRUE(g.graph.apply(robust));
  EXPECT_EQ(refusal(bare, plain), "the engine bare has no robust losses, and the graph holds one");
}

TEST(EngineInterface, SaysARefusalInPlaceOfFigures) {
  Chain g;
  Bare bare(g.graph);
  std::ostringstream text;
  text << bare.solve();
  EXPECT_EQ(text.str(), "NOT solved: the engine bare has no Levenberg-Marquardt\n");
}

// The native engine through the interface alone.
TEST(EngineInterface, IsAllThatIsNeededToSolveAndToAskForCovariances) {
  Chain g;
  const std::unique_ptr<Engine> engine = std::make_unique<NativeEngine>(g.graph);
  const EngineCapabilities can = engine->capabilities();
  EXPECT_TRUE(can.dogleg && can.covariance && can.deterministic && can.linear_priors);
  ASSERT_TRUE(engine->sync());
  EXPECT_TRUE(engine->solve().converged());
  EXPECT_TRUE(check(*engine, g.graph));
  const VariableKey two[] = {g.c, g.a};
  const auto joint = engine->joint_covariance(two);
  const auto c = engine->covariance(g.c);
  ASSERT_TRUE(joint && c);
  ASSERT_EQ(joint->size(), 144u);
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = 0; j < 6; ++j)
      EXPECT_EQ((*joint)[i * 12 + j], (*c)(static_cast<int>(j), static_cast<int>(i))) << i << ", " << j;
}

}  // namespace
}  // namespace oriel
