#include "oriel/linear/linearize.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "oriel/linear/accumulate.h"
#include "oriel/linear/dot.h"

namespace oriel {
namespace {

constexpr std::size_t kRows = Batch::kRows;

std::size_t batches_of(const TablePlan& plan) { return (plan.rows.size() + kRows - 1) / kRows; }

std::int64_t doubles_of(const TablePlan& plan, bool jacobians) {
  const int dim = plan.table->ops().dim;
  int cols = 0;
  for (const auto& a : plan.arguments) cols += a.dim;
  return std::int64_t{kRows} * dim * (1 + (jacobians ? cols : 0));
}

}  // namespace

// Pointers to what the rows of a batch need, and the call to the one function that knows their types.
void Linearizer::run_batch(const Graph& graph, const TablePlan& plan, const Point& point, std::size_t first,
                           bool jacobians, double* r, double* j, Batch& batch) const {
  const FactorTable& table = *plan.table;
  const std::size_t n = std::min(kRows, plan.rows.size() - first), arity = static_cast<std::size_t>(table.arity());
  const void *measurement[kRows], *noise[kRows], *at[16 * kRows], *estimate[16 * kRows];
  const Loss* loss[kRows];
  for (std::size_t l = 0; l < kRows; ++l) {  // past the end: the last row again
    const std::uint32_t row = plan.rows[first + std::min(l, n - 1)];
    measurement[l] = table.measurement(row);
    noise[l] = table.noise(row);
    loss[l] = &table.loss(row);
  }
  const auto refs = table.variables(plan.rows[first]);  // pools are the same in every row
  bool apart = false;
  for (std::size_t k = 0; k < arity; ++k) {
    const std::uint32_t p = refs[k].pool;
    const VariablePool& pool = *graph.pools()[p];
    const std::byte* column = point.column(p);
    const std::size_t bytes = pool.ops().bytes;
    const bool estimates = jacobians && first_estimates && pool.first_estimate_count() > 0;
    for (std::size_t l = 0; l < kRows; ++l) {
      const std::uint32_t d = plan.dense[(first + std::min(l, n - 1)) * arity + k];
      at[k * kRows + l] = estimate[k * kRows + l] = column + d * bytes;
      if (estimates && pool.has_first_estimate(d)) estimate[k * kRows + l] = pool.first_estimate(d), apart = true;
    }
  }
  RowPointers rows;
  rows.rows = static_cast<int>(n);
  rows.active = plan.active[first / kRows];
  rows.measurement = measurement;
  rows.noise = noise;
  rows.loss = table.robust() ? loss : nullptr;
  rows.at = at;
  rows.jacobian_at = apart ? estimate : at;
  batch.r = r;
  batch.J = jacobians ? j : nullptr;
  table.ops().linearize(rows, batch);
}

void Linearizer::evaluate(const Graph& graph, const LinearStructure& structure, const Point& point,
                          const ActiveSet* frozen, ActiveSet& out, TaskPool* pool) {
  std::size_t count = 0;
  for (std::size_t t = 0; t < structure.plan_count(); ++t) count += batches_of(structure.plans()[t]);
  out.valid.assign(count, 0);
  out.not_finite_mask.assign(count, 0);
  out.cost.resize(count * kRows);
  out.invalid = out.not_finite = 0;
  const std::size_t workers = pool != nullptr ? static_cast<std::size_t>(pool->workers()) : 1;
  if (scratch_.size() < workers) scratch_.resize(workers);
  out.prior_cost = prior_cost(graph, structure, point);
  out.total = out.prior_cost;
  std::size_t base = 0;
  for (std::size_t t = 0; t < structure.plan_count(); ++t) {
    const TablePlan& plan = structure.plans()[t];
    const std::size_t batches = batches_of(plan);
    for (AlignedBuffer& s : scratch_) s.reserve(doubles_of(plan, false));
    auto one = [&](int b, int worker) {
      Batch batch;
      run_batch(graph, plan, point, b * kRows, false, scratch_[worker].data(), nullptr, batch);
      const std::size_t at = base + b;
      out.valid[at] = batch.valid;
      out.not_finite_mask[at] = batch.not_finite;
      double* cost = &out.cost[at * kRows];
      std::copy_n(batch.cost, batch.rows, cost);
      std::fill(cost + batch.rows, cost + kRows, 0.0);
      if (frozen == nullptr) return;
      for (int l = 0; l < batch.rows; ++l) {
        const bool counts = (frozen->valid[at] >> l) & 1, valid = (batch.valid >> l) & 1;
        if (!counts)
          cost[l] = 0.0;
        else if (!valid)
          cost[l] = frozen->cost[at * kRows + l];
      }
    };
    parallel_for(pool, static_cast<int>(batches), one);
    for (std::size_t b = 0; b < batches; ++b) {  // sums in the order of batches, whoever computed them
      double sum = 0.0;
      for (std::size_t l = 0; l < kRows; ++l) sum += out.cost[(base + b) * kRows + l];
      out.total += sum;
      out.invalid += std::popcount(plan.active[b]) - std::popcount(out.valid[base + b]);
      out.not_finite += std::popcount(out.not_finite_mask[base + b]);
    }
    base += batches;
  }
}

void Linearizer::lay_out(const LinearStructure& structure) {
  std::int64_t largest = 0;
  for (std::size_t t = 0; t < structure.plan_count(); ++t)
    largest = std::max(largest, doubles_of(structure.plans()[t], true));
  if (scratch_.empty()) scratch_.resize(1);
  scratch_[0].reserve(largest);
}

void Linearizer::linearize(const Graph& graph, const LinearStructure& structure, const Point& point, LinearSystem& out,
                           TaskPool* pool) {
  const std::int64_t h = structure.factorization().storage_size();
  out.h.reserve(h);
  out.landmarks.reserve(structure.landmark_store());
  if (structure.prior_count() > 0) {
    if (prior_h_structure_ != structure.version()) sum_prior_hessians(graph, structure);
    std::copy_n(prior_h_.data(), h, out.h.data());
  } else {
    std::fill_n(out.h.data(), h, 0.0);
  }
  std::fill_n(out.landmarks.data(), structure.landmark_store(), 0.0);
  out.gradient.assign(structure.dim(), 0.0);
  not_finite_ = 0;
  lay_out(structure);
  add_prior_gradients(graph, structure, point, out);
  if (pool != nullptr && pool->workers() > 1)
    linearize_apart(graph, structure, point, out, pool);
  else
    linearize_in_turn(graph, structure, point, out);
  copy_diagonal(structure, out);
}

void Linearizer::linearize_in_turn(const Graph& graph, const LinearStructure& structure, const Point& point,
                                   LinearSystem& out) {
  for (std::size_t t = 0; t < structure.plan_count(); ++t) {
    const TablePlan& plan = structure.plans()[t];
    double* r = scratch_[0].data();
    double* j = r + doubles_of(plan, false);
    for (std::size_t first = 0; first < plan.rows.size(); first += kRows) {
      Batch batch;
      run_batch(graph, plan, point, first, true, r, j, batch);
      not_finite_ += std::popcount(batch.not_finite);
      accumulate(structure, plan, first, batch, out, kernel_fallbacks_);
    }
  }
}

// Several workers: all batches are evaluated beside each other and kept; the sums are then made in the same order as
// by one worker, so the bits are the same.
void Linearizer::linearize_apart(const Graph& graph, const LinearStructure& structure, const Point& point,
                                 LinearSystem& out, TaskPool* pool) {
  for (std::size_t t = 0; t < structure.plan_count(); ++t) {
    const TablePlan& plan = structure.plans()[t];
    const std::size_t batches = batches_of(plan);
    const std::int64_t each = doubles_of(plan, true), r_size = doubles_of(plan, false);
    stored_.reserve(each * static_cast<std::int64_t>(batches));
    if (batches_.size() < batches) batches_.resize(batches);
    parallel_for(pool, static_cast<int>(batches), [&](int b, int) {
      double* r = stored_.data() + each * b;
      run_batch(graph, plan, point, b * kRows, true, r, r + r_size, batches_[b]);
    });
    for (std::size_t b = 0; b < batches; ++b) {
      not_finite_ += std::popcount(batches_[b].not_finite);
      accumulate(structure, plan, b * kRows, batches_[b], out, kernel_fallbacks_);
    }
  }
}

// e = x ⊟ x̂ of all variables of a prior.
void Linearizer::prior_error(const Graph& graph, const PriorPlan& plan, const Point& point) {
  const double* estimate = graph.priors().estimates(plan.row);
  error_.resize(static_cast<std::size_t>(plan.columns.back()));
  for (std::size_t k = 0; k < plan.targets.size(); ++k) {
    const VariableOps& ops = graph.pools()[plan.pool[k]]->ops();
    ops.minus(point.value(plan.pool[k], plan.dense[k]), estimate, error_.data() + plan.columns[k]);
    estimate += estimate_doubles(ops);
  }
}

double Linearizer::prior_cost(const Graph& graph, const LinearStructure& structure, const Point& point) {
  double cost = 0.0;
  for (std::size_t i = 0; i < structure.prior_count(); ++i) {
    const PriorPlan& plan = structure.priors()[i];
    const LinearPriorView p = graph.priors().numbers(plan.row);
    prior_error(graph, plan, point);
    residual_.resize(static_cast<std::size_t>(p.rows));
    evaluate_prior(p, error_.data(), residual_.data());
    double sum = 0.0;
    for (const double r : residual_) sum += r * r;
    cost += 0.5 * sum;
  }
  return cost;
}

void Linearizer::add_prior_gradients(const Graph& graph, const LinearStructure& structure, const Point& point,
                                     LinearSystem& out) {
  for (std::size_t i = 0; i < structure.prior_count(); ++i) {
    const PriorPlan& plan = structure.priors()[i];
    const LinearPriorView p = graph.priors().numbers(plan.row);
    prior_error(graph, plan, point);
    residual_.resize(static_cast<std::size_t>(p.rows));
    evaluate_prior(p, error_.data(), residual_.data());
    for (std::size_t a = 0; a < plan.targets.size(); ++a) {
      if (plan.targets[a].kind != Target::Kind::kept) continue;
      for (int c = plan.columns[a]; c < plan.columns[a + 1]; ++c)
        out.gradient[plan.targets[a].offset + c - plan.columns[a]] +=
            dot(p.R + static_cast<std::size_t>(c) * p.rows, residual_.data(), p.rows);
    }
  }
}

// RᵀR does not depend on the point: the Jacobian of a prior is R wherever x goes.
void Linearizer::sum_prior_hessians(const Graph& graph, const LinearStructure& structure) {
  const std::int64_t h = structure.factorization().storage_size();
  prior_h_.reserve(h);
  std::fill_n(prior_h_.data(), h, 0.0);
  for (std::size_t i = 0; i < structure.prior_count(); ++i) {
    const PriorPlan& plan = structure.priors()[i];
    const LinearPriorView p = graph.priors().numbers(plan.row);
    for (std::size_t a = 0; a < plan.targets.size(); ++a)
      for (std::size_t b = 0; b <= a; ++b) {
        const Target &x = plan.targets[a], &y = plan.targets[b];
        if (x.kind != Target::Kind::kept || y.kind != Target::Kind::kept) continue;
        const BlockAddress at = structure.address(x.index, y.index);
        for (int c = plan.columns[b]; c < plan.columns[b + 1]; ++c)
          for (int k = plan.columns[a]; k < plan.columns[a + 1]; ++k) {
            const std::int64_t row = k - plan.columns[a], col = c - plan.columns[b];
            prior_h_.data()[at.offset + (at.transposed ? row * at.ld + col : col * at.ld + row)] +=
                dot(p.R + static_cast<std::size_t>(k) * p.rows, p.R + static_cast<std::size_t>(c) * p.rows, p.rows);
          }
      }
  }
  prior_h_structure_ = structure.version();
}

void Linearizer::copy_diagonal(const LinearStructure& structure, LinearSystem& out) const {
  out.diagonal.resize(structure.dim());
  const auto& kept = structure.kept();
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const BlockAddress at = structure.address(static_cast<int>(i), static_cast<int>(i));
    for (int k = 0; k < kept[i].dim; ++k)
      out.diagonal[kept[i].offset + k] = out.h.data()[at.offset + std::int64_t{k} * at.ld + k];
  }
  for (const LandmarkBlock& l : structure.landmarks())
    for (int k = 0; k < l.dim; ++k) out.diagonal[l.offset + k] = out.landmarks.data()[l.v() + k * l.dim + k];
}

}  // namespace oriel
