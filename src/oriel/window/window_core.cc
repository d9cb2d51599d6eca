#include "oriel/window/window_core.h"

#include "oriel/linear/evaluate_rows.h"

namespace oriel {
namespace {

constexpr double kLargestSum = 1e300;  // some thousands of these are still a number

// Does lane l hold numbers whose squares a sum can take? What is invalid is in no sum.
bool summable(const Batch& batch, int l) {
  if (((batch.valid >> l) & 1) == 0) return true;
  double squares = batch.cost[l];
  for (int i = 0; i < batch.dim; ++i) squares += batch.r[i * Batch::kRows + l] * batch.r[i * Batch::kRows + l];
  for (int i = 0; i < batch.dim * batch.cols; ++i)
    squares += batch.J[i * Batch::kRows + l] * batch.J[i * Batch::kRows + l];
  return squares < kLargestSum;
}

}  // namespace

Result<void> WindowCore::commit() {
  if (edit_.empty()) return {};
  if (auto ok = graph_.apply(edit_); !ok) return ok;
  if (observer_ != nullptr) observer_->edited();
  return {};
}

void WindowCore::observe(WindowObserver* observer) {
  check(observer == nullptr || (solver_ == nullptr && deferred_ == nullptr),
        "a window is not observed while another engine solves it");
  observer_ = observer;
}

Result<void> WindowCore::use(std::unique_ptr<Engine> solver) {
  if (solver != nullptr && observer_ != nullptr)
    return Error{ErrorCode::conflict, "the engine " + std::string(solver->name()) +
                                          " cannot solve an observed window: a journal replays native solves alone"};
  if (solver != nullptr && deferred_ != nullptr)
    return Error{ErrorCode::conflict, "the window's solves are deferred: they cannot go to an engine as well"};
  solver_ = std::move(solver);
  return {};
}

Result<void> WindowCore::defer_to(std::unique_ptr<DeferredSolver> solver) {
  if (solver != nullptr && observer_ != nullptr)
    return Error{ErrorCode::conflict, "the solver " + std::string(solver->name()) +
                                          " cannot solve an observed window: a journal replays native solves alone"};
  if (solver != nullptr && solver_ != nullptr)
    return Error{ErrorCode::conflict, "another engine solves the window: its solves cannot be deferred as well"};
  if (begun_) return Error{ErrorCode::conflict, "a solve was begun and is not finished: settle the window first"};
  deferred_ = std::move(solver);
  return {};
}

Result<void> WindowCore::begin_solve(const SolveOptions& options) {
  if (auto ok = deferred_->begin(options); !ok) {
    note_refusal(ok.error().message);
    return ok;
  }
  begun_ = true;
  return {};
}

Summary WindowCore::finish_solve() {
  begun_ = false;
  Summary summary = deferred_->finish();
  if (summary.reason == Reason::refused) note_refusal(summary.refusal);
  return summary;
}

void WindowCore::note_refusal(const std::string& why) {
  if (refused_.count++ == 0) refused_.first = why;
}

Summary WindowCore::solve(const SolveOptions& options) {
  const SolverState before = solver_ != nullptr ? SolverState{} : engine_.state();
  Summary summary = solver_ != nullptr ? solver_->solve(options) : engine_.solve(options);
  if (summary.reason == Reason::refused) note_refusal(summary.refusal);
  if (observer_ != nullptr) observer_->solved(options, before, summary, engine_);
  return summary;
}

Result<MarginalizeReport> WindowCore::slide(std::span<const VariableKey> leaving, const MarginalizeOptions& options) {
  Result<MarginalizeReport> report = marginalizer_.marginalize(graph_, leaving, options, edit());
  if (!report) return report;
  if (auto ok = commit(); !ok) return ok.error();
  return report;
}

Result<void> WindowCore::drop(std::span<const VariableKey> leaving, LandmarkPolicy landmarks) {
  if (auto ok = scope_.collect(graph_, leaving, landmarks); !ok) return ok;
  GraphEdit& all = edit();
  for (const MarginalVariable& v : scope_.variables())
    if (v.role != MarginalVariable::Role::staying) all.remove(v.id);
  // Those of their priors as well: graphs would keep what these say of the variables that stay.
  for (const MarginalPrior& p : scope_.priors())
    all.remove(FactorId{PriorTable::kKey, graph_.priors().slots().key(p.row)});
  return commit();
}

void WindowCore::find_overflowing(const FactorTable& table, std::vector<FactorId>& found) {
  int columns = 0;
  for (const VariableOps* ops : table.ops().variables) columns += ops->dim;
  AlignedBuffer r, j;  // this is rare: no memory is kept for it
  r.reserve(std::int64_t{Batch::kRows} * table.ops().dim);
  j.reserve(std::int64_t{Batch::kRows} * table.ops().dim * columns);
  std::vector<std::uint32_t> rows;
  for (std::uint32_t row = 0; row < table.extent(); ++row) {
    if (table.slots().is_live(row)) rows.push_back(row);
    if (rows.empty() || (row + 1 < table.extent() && rows.size() < Batch::kRows)) continue;
    Batch batch;
    evaluate_rows(graph_, table, rows, nullptr, false, r.data(), j.data(), batch);
    for (int l = 0; l < batch.rows; ++l)
      if (!summable(batch, l)) found.push_back({table.ops().key, table.slots().key(rows[l])});
    rows.clear();
  }
}

Result<void> WindowCore::remove_overflowing(std::vector<FactorId>& removed) {
  std::vector<FactorId> found;
  for (const auto& table : graph_.tables()) find_overflowing(*table, found);
  GraphEdit& all = edit();
  for (const FactorId id : found) all.remove(id);
  if (auto ok = commit(); !ok) return ok;
  removed.insert(removed.end(), found.begin(), found.end());
  return {};
}

Result<void> WindowCore::clear() {
  GraphEdit& all = edit();
  for (const auto& pool : graph_.pools())
    for (std::uint32_t d = 0; d < pool->extent(); ++d)
      if (pool->slots().is_live(d)) all.remove(VariableKey{pool->ops().key, pool->slots().key(d)});
  return commit();
}

}  // namespace oriel
