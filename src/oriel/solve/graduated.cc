#include "oriel/solve/graduated.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "oriel/linear/linearize_factor.h"

namespace oriel {
namespace {

constexpr double kNearlyTruncated = 1e4;  // μ from which on the graduated form is the truncated one to 1e-4 of c²

struct Graduated {
  FactorId id;
  Loss loss;
};

bool is_graduated(const Loss& loss) { return loss.kind == LossKind::geman_mcclure || loss.kind == LossKind::truncated; }

std::vector<Graduated> find_graduated(const Graph& graph) {
  std::vector<Graduated> found;
  for (const auto& table : graph.tables())
    for (std::uint32_t row = 0; row < table->extent(); ++row)
      if (table->slots().is_live(row) && is_graduated(table->loss(row)))
        found.push_back({{table->ops().key, table->slots().key(row)}, table->loss(row)});
  return found;
}

// The largest s / c² of them; the graph holds them without a loss.
double largest_share(const Graph& graph, const std::vector<Graduated>& factors) {
  double most = 0.0;
  for (const Graduated& f : factors) {
    const auto at = linearize_factor(graph, f.id, false);
    if (at && at->valid) most = std::max(most, 2.0 * at->cost / (f.loss.scale * f.loss.scale));
  }
  return most;
}

// How far the way is: 0 at the start, 1 at the end. One number for both kinds: Geman–McClure's μ falls where the
// truncated one's rises.
class Schedule {
 public:
  Schedule(double share, double growth) : growth_(growth) {
    truncated_ = share > 0.5 ? 1.0 / (2.0 * share - 1.0) : std::numeric_limits<double>::infinity();
    geman_mcclure_ = std::max(1.0, 2.0 * share);
  }
  bool is_done() const { return truncated_ >= kNearlyTruncated && geman_mcclure_ <= 1.0; }
  void advance() {
    truncated_ *= growth_;
    geman_mcclure_ = std::max(1.0, geman_mcclure_ / growth_);
  }
  Loss loss(const Loss& given) const {
    if (given.kind == LossKind::truncated) return TruncatedSquares(given.scale, truncated_);
    return GemanMcClure(given.scale * std::sqrt(geman_mcclure_));
  }

 private:
  double growth_, truncated_, geman_mcclure_;
};

class GraduatedSolve {
 public:
  GraduatedSolve(Graph& graph, Engine& engine, const GraduatedOptions& options)
      : graph_(graph), engine_(engine), options_(options), factors_(find_graduated(graph)) {}

  Result<GraduatedReport> run() {
    report_.graduated = static_cast<std::int64_t>(factors_.size());
    bool fine = true;
    if (!factors_.empty()) {
      const Result<bool> through = graduate();
      const Result<void> restored = set([](const Loss& given) { return given; });
      if (!through) return through.error();
      if (!restored) return restored.error();
      fine = *through;
    }
    if (fine) round(options_.solve);
    for (const Graduated& f : factors_)
      if (is_outlier(f)) report_.outliers.push_back(f.id);
    return std::move(report_);
  }

 private:
  // False where a round failed.
  Result<bool> graduate() {
    SolveOptions some = options_.solve;
    if (auto ok = set([](const Loss&) { return Loss::none(); }); !ok) return ok.error();
    round(some);  // least squares, to its minimum: it says how far out the worst is
    if (some.max_iterations < 0 || some.max_iterations > options_.round_iterations)
      some.max_iterations = options_.round_iterations;
    Schedule schedule(largest_share(graph_, factors_), options_.growth);
    for (; !report_.summary.failed() && !schedule.is_done() && report_.rounds < options_.max_rounds;
         schedule.advance()) {
      if (auto ok = set([&](const Loss& given) { return schedule.loss(given); }); !ok) return ok.error();
      round(some);
    }
    return !report_.summary.failed();
  }

  void round(const SolveOptions& options) {
    report_.summary = engine_.solve(options);
    ++report_.rounds;
    report_.iterations += report_.summary.iterations;
  }

  template <class F>
  Result<void> set(F&& loss_of) {
    edit_.clear();
    for (const Graduated& f : factors_) edit_.set(f.id, loss_of(f.loss));
    return graph_.apply(edit_);
  }

  // s > c², by ρ(s).
  bool is_outlier(const Graduated& f) const {
    const auto at = linearize_factor(graph_, f.id, false);
    if (!at || !at->valid) return true;
    const double c2 = f.loss.scale * f.loss.scale;
    return 2.0 * at->cost >= (f.loss.kind == LossKind::truncated ? c2 : 0.5 * c2) * (1.0 - 1e-12);
  }

  Graph& graph_;
  Engine& engine_;
  const GraduatedOptions& options_;
  const std::vector<Graduated> factors_;
  GraphEdit edit_ = graph_.edit();
  GraduatedReport report_;
};

}  // namespace

Result<GraduatedReport> solve_graduated(Graph& graph, Engine& engine, const GraduatedOptions& options) {
  return GraduatedSolve(graph, engine, options).run();
}

}  // namespace oriel
