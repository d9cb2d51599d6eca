#include "oriel/window/marginalize.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "oriel/linear/evaluate_rows.h"

namespace oriel {
namespace {

// Up to here reflections cost less than 0.1 ms [flop].
constexpr double kQrFlops = 3e5;

void clear_lane(Batch& batch, int l) {
  batch.valid &= ~(std::uint64_t{1} << l);
  for (int i = 0; i < batch.dim; ++i) batch.r[i * Batch::kRows + l] = 0.0;
  for (int i = 0; i < batch.dim * batch.cols; ++i) batch.J[i * Batch::kRows + l] = 0.0;
}

}  // namespace

Result<MarginalizeReport> Marginalizer::marginalize(Graph& graph, std::span<const VariableKey> leaving,
                                                    const MarginalizeOptions& options, GraphEdit& edit) {
  edit.clear();
  if (auto ok = scope_.collect(graph, leaving, options.landmarks, options.types, options.ledger != nullptr); !ok)
    return ok.error();
  if (options.ledger != nullptr) {
    options.ledger->discard();
    options.ledger->stage_known(graph, scope_);
  }
  held_.begin(graph, scope_);
  root_.keep_conditional = options.ledger != nullptr;
  MarginalizeReport report;
  report.closed_landmarks = scope_.closed_landmarks;
  report.dropped_landmarks = scope_.dropped_landmarks;
  report.kept_landmarks = scope_.kept_landmarks;
  report.leaving_landmarks = scope_.leaving_landmarks;
  report.dropped_with_landmarks = scope_.dropped_factors;
  report.dropped_variables = scope_.dropped_variables;
  edit.require_version(graph.version());
  for (const MarginalVariable& v : scope_.variables()) {
    if (v.role != MarginalVariable::Role::staying) edit.remove(v.id);
    if (v.held) edit.fix(v.id);
  }
  for (const MarginalPrior& p : scope_.priors())
    edit.remove(FactorId{PriorTable::kKey, graph.priors().slots().key(p.row)});
  for (const MarginalComponent& component : scope_.components()) {
    absorb(graph, component, options, report);
    for (const UndeterminedColumn& u : root_.undetermined)
      report.undetermined.push_back({scope_.variables()[u.variable].id, u.tangent});
    if (options.fail_if_undetermined && !root_.undetermined.empty()) {
      const UndeterminedScalar& first = report.undetermined.front();
      const auto names = graph.find_ops(first.id.type)->tangent_names;
      edit.clear();
      if (options.ledger != nullptr) options.ledger->discard();
      return Error{ErrorCode::singular,
                   "marginalize: nothing determines " +
                       (names.empty() ? "scalar " + std::to_string(first.tangent) : std::string(names[first.tangent])) +
                       " of " + graph.describe(first.id)};
    }
    // Its rows are in the axes of held directions: late data end there (decision 11).
    const bool restricted = held_.rows(scope_, component) > 0;
    if (options.ledger != nullptr && !restricted) options.ledger->stage(graph, scope_, component, root_);
    write_priors(graph, component, options, edit, report);
  }
  return report;
}

bool Marginalizer::choose_qr(const Graph& graph, const MarginalComponent& component,
                             const MarginalizeOptions& options) {
  stacked_rows_ = held_.rows(scope_, component);
  for (std::uint32_t i = component.rows_begin; i < component.rows_end; ++i)
    stacked_rows_ += graph.tables()[scope_.rows()[i].table]->ops().dim;
  for (std::uint32_t i = component.priors_begin; i < component.priors_end; ++i)
    stacked_rows_ += graph.priors().shape(scope_.priors()[i].row).rows;
  if (options.method != SquareRootMethod::automatic) return options.method == SquareRootMethod::qr;
  const double n = component.landmark_dim + component.dim();
  return 2.0 * stacked_rows_ * n * n <= kQrFlops;
}

// The linearized factors and old priors of a component, reduced to what they say about the variables that stay.
void Marginalizer::absorb(const Graph& graph, const MarginalComponent& component, const MarginalizeOptions& options,
                          MarginalizeReport& report) {
  use_qr_ = choose_qr(graph, component, options);
  if (use_qr_)
    stack_.begin(scope_, component, stacked_rows_);
  else
    sum_.begin(scope_, component);
  const std::span<const MarginalRow> rows(scope_.rows().data(), scope_.rows().size());
  for (std::uint32_t begin = component.rows_begin; begin < component.rows_end;) {
    std::uint32_t end = begin + 1;
    while (end < component.rows_end && end - begin < Batch::kRows && rows[end].major == rows[begin].major) ++end;
    evaluate(graph, rows.subspan(begin, end - begin), options, report);
    const bool chunk_ends = end == component.rows_end || rows[end].chunk != rows[begin].chunk;
    if (!use_qr_ && chunk_ends && component.landmark_dim > 0) sum_.eliminate_landmarks(rows[begin].chunk);
    begin = end;
  }
  for (std::uint32_t i = component.priors_begin; i < component.priors_end; ++i)
    absorb_prior(graph, scope_.priors()[i], report);
  if (!held_.empty()) add(held_.known(scope_, component));
  if (use_qr_)
    stack_.finish(root_);
  else
    sum_.finish(root_);
}

void Marginalizer::evaluate(const Graph& graph, std::span<const MarginalRow> rows, const MarginalizeOptions& options,
                            MarginalizeReport& report) {
  const FactorTable& table = *graph.tables()[rows[0].table];
  batch_.arguments = 0;
  int columns = 0;
  for (const VariableOps* ops : table.ops().variables) {
    if (ops->dim == 0) continue;
    batch_.argument[batch_.arguments++] = {ops->dim, columns};
    columns += ops->dim;
  }
  table_rows_.clear();
  for (std::size_t l = 0; l < rows.size(); ++l) {
    table_rows_.push_back(rows[l].row);
    const auto variables = scope_.arguments(rows[l].arguments);
    std::copy(variables.begin(), variables.end(), batch_.variable + l * AbsorbedBatch::kLargestArity);
  }
  r_.reserve(std::int64_t{Batch::kRows} * table.ops().dim);
  j_.reserve(std::int64_t{Batch::kRows} * table.ops().dim * columns);
  Batch batch;
  evaluate_rows(graph, table, table_rows_, nullptr, options.first_estimates, r_.data(), j_.data(), batch);
  judge(table, batch, options, report);
  if (!held_.empty()) held_.restrict(batch_, batch);
  batch_.batch = &batch;
  if (use_qr_)
    stack_.add(batch_);
  else
    sum_.add(batch_);
}

void Marginalizer::judge(const FactorTable& table, Batch& batch, const MarginalizeOptions& options,
                         MarginalizeReport& report) {
  report.dropped_invalid += batch.rows - std::popcount(batch.valid);
  const double t = options.outlier_threshold;
  for (int l = 0; t > 0.0 && l < batch.rows; ++l) {
    if (((batch.valid >> l) & 1) == 0) continue;
    if (!is_outlier(batch, l, table.loss(table_rows_[l]), t)) continue;
    clear_lane(batch, l);
    ++report.dropped_outliers;
  }
  report.absorbed_factors += std::popcount(batch.valid);
}

void Marginalizer::absorb_prior(const Graph& graph, const MarginalPrior& prior, MarginalizeReport& report) {
  const LinearPriorView p = graph.priors().numbers(prior.row);
  const double* estimate = graph.priors().estimates(prior.row);
  error_.resize(p.cols);
  residual_.resize(p.rows);
  targets_.clear();
  int column = 0;
  for (const std::int32_t at : scope_.arguments(prior.arguments)) {
    const MarginalVariable& v = scope_.variables()[at];
    const VariablePool& pool = *graph.pools()[v.pool];
    pool.ops().minus(pool.value(v.dense), estimate, error_.data() + column);
    for (int i = 0; i < v.dim; ++i) targets_.push_back(v.has_columns() ? v.column + i : -1);
    column += v.dim;
    estimate += estimate_doubles(pool.ops());
  }
  evaluate_prior(p, error_.data(), residual_.data());
  const double* R = p.R;
  if (!held_.empty()) {
    restricted_.assign(p.R, p.R + static_cast<std::size_t>(p.rows) * static_cast<std::size_t>(p.cols));
    held_.restrict(scope_, scope_.arguments(prior.arguments), p.rows, restricted_);
    R = restricted_.data();
  }
  add({p.rows, p.cols, R, residual_.data(), targets_.data()});
  ++report.absorbed_priors;
}

void Marginalizer::add(const AbsorbedPrior& prior) {
  if (use_qr_)
    stack_.add(prior);
  else
    sum_.add(prior);
}

// x̂ of a variable goes to the prior, and x0 ⊟ x̂ to error_; false where they are the same.
bool Marginalizer::shift(const Graph& graph, const MarginalVariable& v, bool first_estimates) {
  const VariablePool& pool = *graph.pools()[v.pool];
  const bool estimated = first_estimates && pool.has_first_estimate(v.dense);
  const void* value = pool.value(v.dense);
  const void* estimate = estimated ? pool.first_estimate(v.dense) : value;
  const std::size_t at = prior_.estimates.size();
  prior_.estimates.resize(at + estimate_doubles(pool.ops()), 0.0);
  std::memcpy(prior_.estimates.data() + at, estimate, pool.ops().bytes);
  if (!estimated || std::memcmp(value, estimate, pool.ops().bytes) == 0) return false;
  error_.resize(v.dim);
  pool.ops().minus(value, estimate, error_.data());
  return true;
}

// Which staying columns stay tied (tied_) and which get a prior of their own (own_); false if all are tied.
bool Marginalizer::mark_untied(const MarginalComponent& component, std::span<const TypePolicy> types,
                               MarginalizeReport& report) {
  tied_.assign(static_cast<std::size_t>(root_.cols), 1);
  own_.assign(static_cast<std::size_t>(root_.cols), 0);
  int touched = 0, untied = 0;
  for (std::uint32_t o = component.variables_begin; o < component.variables_end; ++o) {
    const MarginalVariable& v = scope_.variables()[scope_.ordered()[o]];
    if (v.eliminated || v.role != MarginalVariable::Role::staying) continue;
    const auto column = static_cast<std::ptrdiff_t>(v.column - component.leaving_dim);
    const double* const R = root_.R.data() + column * root_.rows;
    if (std::all_of(R, R + static_cast<std::ptrdiff_t>(v.dim) * root_.rows, [](double x) { return x == 0.0; }))
      continue;
    ++touched;
    const Tie tie = policy_of(types, v.id.type).tie;
    if (tie == Tie::all) continue;
    std::fill_n(tied_.begin() + column, v.dim, 0);
    std::fill_n(own_.begin() + column, v.dim, tie == Tie::own);
    ++untied;
  }
  report.dropped_ties += untied * (touched - untied) + untied * (untied - 1) / 2;
  return untied > 0;
}

void Marginalizer::write_priors(const Graph& graph, const MarginalComponent& component,
                                const MarginalizeOptions& options, GraphEdit& edit, MarginalizeReport& report) {
  const bool all_tied =
      std::all_of(options.types.begin(), options.types.end(), [](const TypePolicy& p) { return p.tie == Tie::all; });
  if (all_tied || !mark_untied(component, options.types, report))
    return write_prior(graph, component, root_, options.first_estimates, edit, report);
  auto write = [&](const std::vector<char>& columns) {
    marginal_(root_, columns, part_);
    write_prior(graph, component, part_, options.first_estimates, edit, report);
  };
  write(tied_);
  for (std::uint32_t o = component.variables_begin; o < component.variables_end; ++o) {
    const MarginalVariable& v = scope_.variables()[scope_.ordered()[o]];
    const int column = v.column - component.leaving_dim;
    if (v.eliminated || v.role != MarginalVariable::Role::staying || own_[column] == 0) continue;
    tied_.assign(tied_.size(), 0);
    std::fill_n(tied_.begin() + column, v.dim, 1);
    write(tied_);
  }
}

// The columns that say nothing are left out: a variable that no valid factor tied to the others is not in the prior.
void Marginalizer::write_prior(const Graph& graph, const MarginalComponent& component, const SquareRootRows& root,
                               bool first_estimates, GraphEdit& edit, MarginalizeReport& report) {
  const auto rows = static_cast<std::size_t>(root.rows);
  if (rows == 0) return;
  prior_.variables.clear();
  prior_.estimates.clear();
  prior_.R.clear();
  prior_.d.assign(root.d.begin(), root.d.end());
  prior_.rows = root.rows, prior_.cols = 0;
  for (std::uint32_t o = component.variables_begin; o < component.variables_end; ++o) {
    const MarginalVariable& v = scope_.variables()[scope_.ordered()[o]];
    if (v.eliminated || v.role != MarginalVariable::Role::staying) continue;
    const double* const R = root.R.data() + rows * static_cast<std::size_t>(v.column - component.leaving_dim);
    const std::size_t size = rows * static_cast<std::size_t>(v.dim);
    if (std::all_of(R, R + size, [](double x) { return x == 0.0; })) continue;
    prior_.variables.push_back(v.id);
    prior_.R.insert(prior_.R.end(), R, R + size);
    prior_.cols += v.dim;
    if (!shift(graph, v, first_estimates)) continue;
    for (int c = 0; c < v.dim; ++c)
      for (std::size_t i = 0; i < rows; ++i) prior_.d[i] -= R[c * rows + i] * error_[c];
  }
  edit.add(prior_);
  ++report.priors;
  report.prior_rows += prior_.rows;
  report.prior_cols += prior_.cols;
}

}  // namespace oriel
