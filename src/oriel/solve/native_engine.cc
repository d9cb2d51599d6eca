#include "oriel/solve/native_engine.h"

#include <utility>

#include "oriel/solve/minimizer.h"

namespace oriel {

NativeEngine::NativeEngine(Graph& graph) : graph_(&graph) {}
NativeEngine::NativeEngine(NativeEngine&&) noexcept = default;
NativeEngine& NativeEngine::operator=(NativeEngine&&) noexcept = default;
NativeEngine::~NativeEngine() = default;

Summary NativeEngine::solve(const SolveOptions& options) noexcept { return Minimizer(*this, options).run(); }

EngineCapabilities NativeEngine::capabilities() const noexcept {
  EngineCapabilities can;
  can.levenberg_marquardt = can.gauss_newton = can.dogleg = true;
  can.conjugate_gradient = can.orderings = can.deadline = can.callback = can.threads = true;
  can.losses = can.linear_priors = can.first_estimates = can.freedoms = can.covariance = can.deterministic = true;
  return can;  // not incremental: it is for large graphs without landmarks alone
}

SolveOptions NativeEngine::for_question() const {
  SolveOptions options;
  options.linear_solver = structure_solver_;
  options.ordering = structure_ordering_;
  return options;
}

Result<void> NativeEngine::sync() noexcept { return sync(for_question(), For::solve); }

void NativeEngine::restore(const SolverState& state) {
  if (!(state.order == state_.order)) structure_version_ = ~std::uint64_t{0}, has_asked_ = false;
  state_ = state;
}

double NativeEngine::cost() noexcept {
  if (!sync(for_question(), For::question)) return HUGE_VAL;
  point_.take(*graph_);
  linearizer_.evaluate(*graph_, structure_, point_, nullptr, active_, nullptr);
  return active_.total;
}

Result<void> NativeEngine::linearize(bool first_estimates) {
  SolveOptions options = for_question();
  options.linear_solver = LinearSolver::direct;
  if (auto ok = sync(options, For::question); !ok) return ok;
  point_.take(*graph_);
  linearizer_.first_estimates = first_estimates;
  linearizer_.evaluate(*graph_, structure_, point_, nullptr, active_, nullptr);
  linearizer_.linearize(*graph_, structure_, point_, &active_, system_, nullptr);
  restriction_.apply(*graph_, structure_, point_, system_);
  return {};
}

void NativeEngine::drop_caches() {
  const SolverState kept = state_;
  const bool failed = failed_, first_estimates = linearizer_.first_estimates;
  Graph* graph = graph_;
  *this = NativeEngine(*graph);
  state_ = kept;
  failed_ = failed;
  linearizer_.first_estimates = first_estimates;
}

// What is small is solved directly, whoever chooses.
bool NativeEngine::is_solved_by(LinearSolver solver) const {
  const bool chooses =
      solver != LinearSolver::conjugate_gradient && structure_solver_ != LinearSolver::conjugate_gradient;
  return solver == structure_solver_ || (chooses && !structure_.is_large());
}

Result<void> NativeEngine::sync(const SolveOptions& options, For what) {
  if (structure_version_ != graph_->structure_version() || structure_ordering_ != options.ordering ||
      !is_solved_by(options.linear_solver) || structure_.pool_count() != graph_->pools().size()) {
    FactorOptions factor;
    factor.linear_solver = options.linear_solver;
    factor.ordering =
        options.ordering == OrderingMethod::given ? OrderingMethod::automatic : options.ordering;  // nobody gives one
    structure_version_ = ~std::uint64_t{0};  // half a structure is none
    if (what == For::question) asked_ = state_.order;
    EliminationOrder& order = what == For::question ? asked_ : state_.order;
    has_asked_ = false;
    if (auto ok = structure_.build(*graph_, factor, order); !ok) return ok;
    has_asked_ = what == For::question && !(asked_ == state_.order);
    if (structure_.forms_reduced()) {
      schur_.prepare(structure_);
    } else {
      conjugate_gradient_.prepare(structure_);
      product_.prepare(structure_);
    }
    structure_version_ = graph_->structure_version();
    structure_ordering_ = options.ordering;
    structure_solver_ = options.linear_solver;
  }
  restriction_.prepare(*graph_, structure_);
  // The same graph by the same state has the same order.
  if (what == For::solve && std::exchange(has_asked_, false)) state_.order = asked_;
  trial_.take(*graph_);  // what does not move stands in both points
  return {};
}

TaskPool* NativeEngine::pool(int threads) {
  if (threads <= 1) return nullptr;
  if (!threads_ || threads_->workers() != threads) threads_ = make_owned<ThreadPool>(threads);
  return threads_.get();
}

bool NativeEngine::adopt_point() {
  const auto& pools = graph_->pools();
  solution_.columns.resize(pools.size());
  for (std::size_t p = 0; p < pools.size(); ++p) {
    Solution::Column& c = solution_.columns[p];
    const VariablePool& pool = *pools[p];
    if (c.ops != &pool.ops()) c = {&pool.ops(), {}, ByteColumn(pool.ops().bytes)};
    c.keys.clear();
    c.values.clear();
    for (std::uint32_t d = 0; d < pool.extent(); ++d) {
      if (structure_.offsets(p)[d] < 0) continue;
      c.keys.push_back(pool.slots().key(d));
      c.values.push_back(point_.value(p, d));
    }
  }
  if (!graph_->adopt(solution_)) return false;
  state_.solved_version = graph_->version();
  return true;
}

}  // namespace oriel
