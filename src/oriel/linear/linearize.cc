#include "oriel/linear/linearize.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "oriel/linear/dot.h"
#include "oriel/linear/plan_batches.h"
#include "oriel/linear/row_pointers.h"

namespace oriel {
namespace {

constexpr std::size_t kRows = Batch::kRows;
constexpr std::size_t kTogether = 8;  // batches that a worker evaluates at a time

}  // namespace

// Sums in the order of batches, whoever computed them.
void Linearizer::add_up(const LinearStructure& structure, ActiveSet& set) {
  set.total = set.prior_cost;
  set.invalid = set.not_finite = 0;
  std::size_t at = 0;
  for (std::size_t t = 0; t < structure.plan_count(); ++t)
    for (const std::uint64_t active : structure.plans()[t].active) {
      double sum = 0.0;
      for (std::size_t l = 0; l < kRows; ++l) sum += set.cost[at * kRows + l];
      set.total += sum;
      set.invalid += std::popcount(active) - std::popcount(set.valid[at]);
      set.not_finite += std::popcount(set.not_finite_mask[at] | set.no_jacobian[at]);
      ++at;
    }
}

// Pointers to what the rows of a batch need, and the call to the one function that knows their types.
void Linearizer::run_batch(const Graph& graph, const TablePlan& plan, const Point& point, const Place& place,
                           const ActiveSet* evaluated, double* r, double* j, Batch& batch) const {
  const FactorTable& table = *plan.table;
  const std::size_t first = place.index * kRows, arity = static_cast<std::size_t>(table.arity());
  std::size_t n = std::min(kRows, plan.rows.size() - first);
  if (plan.runs.empty()) n = std::min(n, static_cast<std::size_t>(std::bit_width(plan.active[place.index])));
  RowPointerArrays arrays;
  RowPointers rows;
  rows.robust = table.robust();
  if (table.ops().packed)
    rows.packed = packed_[place.plan].numbers.data() + first * packed_[place.plan].packs;
  else
    point_measurements(
        table, n, [&](std::size_t l) { return plan.rows[first + l]; }, arrays, rows);
  auto dense = [&](std::size_t l, std::size_t k) { return plan.dense[(first + l) * arity + k]; };
  point_values(graph, table.variables(plan.rows[first]), n, &point, j != nullptr && first_estimates, dense, arrays,
               rows);
  rows.active = plan.active[place.index];
  EvaluatedRows before;
  const std::size_t at = place.before + place.index;
  if (evaluated != nullptr && evaluated->has_residuals && evaluated->no_jacobian[at] == 0) {
    const std::int64_t each = doubles_of(plan, false);
    before = {evaluated->valid[at], evaluated->residuals.data() + place.residuals + each * std::int64_t(place.index),
              table.robust() ? &evaluated->weight[at * kRows] : nullptr, &evaluated->cost[at * kRows]};
    rows.evaluated = &before;
  }
  batch.r = r;
  batch.J = j;
  table.ops().linearize(rows, batch);
}

void Linearizer::evaluate(const Graph& graph, const LinearStructure& structure, const Point& point,
                          const ActiveSet* frozen, ActiveSet& out, TaskPool* pool) {
  std::size_t count = 0;
  for (std::size_t t = 0; t < structure.plan_count(); ++t) count += batches_of(structure.plans()[t]);
  if (frozen != nullptr)
    out.no_jacobian = frozen->no_jacobian;
  else
    out.no_jacobian.assign(count, 0);
  sum_costs(graph, structure, point, frozen, out, pool);
}

void Linearizer::refresh(const Graph& graph, const LinearStructure& structure, const Point& point, ActiveSet& set,
                         TaskPool* pool) {
  sum_costs(graph, structure, point, nullptr, set, pool);
}

void Linearizer::sum_costs(const Graph& graph, const LinearStructure& structure, const Point& point,
                           const ActiveSet* frozen, ActiveSet& out, TaskPool* pool) {
  lay_out(graph, structure, out);
  if (pool != nullptr && scratch_.size() < static_cast<std::size_t>(pool->workers())) scratch_.resize(pool->workers());
  out.prior_cost = prior_cost(graph, structure, point);
  Place place;
  for (std::size_t t = 0; t < structure.plan_count(); ++t) {
    place.plan = t;
    const TablePlan& plan = structure.plans()[t];
    const std::size_t batches = batches_of(plan);
    const std::int64_t each = doubles_of(plan, false);
    for (AlignedBuffer& s : scratch_) s.reserve(each);
    parallel_for(pool, static_cast<int>((batches + kTogether - 1) / kTogether), [&](int task, int worker) {
      Place at = place;
      at.index = static_cast<std::size_t>(task) * kTogether;
      for (const std::size_t end = std::min(at.index + kTogether, batches); at.index < end; ++at.index) {
        double* r = out.has_residuals ? out.residuals.data() + at.residuals + each * static_cast<std::int64_t>(at.index)
                                      : scratch_[static_cast<std::size_t>(worker)].data();
        Batch batch;
        run_batch(graph, plan, point, at, nullptr, r, nullptr, batch);
        keep(batch, plan.table->robust(), at.before + at.index, frozen, out);
      }
    });
    place.before += batches;
    place.residuals += each * static_cast<std::int64_t>(batches);
  }
  add_up(structure, out);
}

// What rows measured does not change while they live: a cache, made once a structure.
void Linearizer::pack_measurements(const LinearStructure& structure) {
  if (packed_structure_ == structure.version()) return;
  packed_structure_ = structure.version();
  if (packed_.size() < structure.plan_count()) packed_.resize(structure.plan_count());
  for (std::size_t t = 0; t < structure.plan_count(); ++t) {
    const TablePlan& plan = structure.plans()[t];
    const FactorTable& table = *plan.table;
    if (!table.ops().packed) continue;
    const int measurement = static_cast<int>(table.ops().measurement_bytes / sizeof(double)),
              noise = static_cast<int>(table.ops().noise_bytes / sizeof(double));
    Packed& packed = packed_[t];
    packed.packs = std::size_t(measurement) + noise + (table.robust() ? detail::kLossPacks : 0);
    // Where a reader finds the losses that are not there.
    constexpr std::size_t kPastTheEnd = std::size_t{detail::kLossPacks} * Pack::kLanes;
    packed.numbers.reserve(static_cast<std::int64_t>((plan.rows.size() + Pack::kLanes) * packed.packs + kPastTheEnd));
    RowPointerArrays arrays;
    RowPointers rows;
    for (std::size_t g = 0; g < plan.rows.size(); g += Pack::kLanes) {
      const std::size_t n = std::min(std::size_t{Pack::kLanes}, plan.rows.size() - g);
      point_measurements(
          table, n, [&](std::size_t l) { return plan.rows[g + l]; }, arrays, rows);
      pack_rows(rows.measurement, measurement, rows.noise, noise, table.robust() ? rows.loss : nullptr,
                packed.numbers.data() + g * packed.packs);
    }
  }
}

// Room for all batches.
void Linearizer::lay_out(const Graph& graph, const LinearStructure& structure, ActiveSet& out) {
  const std::size_t count = out.no_jacobian.size();
  std::int64_t doubles = 0;
  for (std::size_t t = 0; t < structure.plan_count(); ++t) {
    const TablePlan& plan = structure.plans()[t];
    doubles += doubles_of(plan, false) * static_cast<std::int64_t>(batches_of(plan));
  }
  out.valid.assign(count, 0);
  out.not_finite_mask.assign(count, 0);
  out.cost.resize(count * kRows);
  out.has_residuals = first_estimates && std::any_of(graph.pools().begin(), graph.pools().end(),
                                                     [](const auto& p) { return p->first_estimate_count() > 0; });
  if (out.has_residuals) {
    out.residuals.reserve(doubles);
    out.weight.resize(count * kRows);
  }
  if (scratch_.empty()) scratch_.resize(1);
  pack_measurements(structure);
}

// What a batch came to, as batch `at` of all. Of a frozen set's factors, one that is invalid here is charged its old
// cost, and no other counts (decision 12). One whose residual overflows here costs infinitely much: to drop it would
// make a leap into an overflow look like a gain.
void Linearizer::keep(const Batch& batch, bool robust, std::size_t at, const ActiveSet* frozen, ActiveSet& out) {
  out.valid[at] = batch.valid & ~out.no_jacobian[at];
  out.not_finite_mask[at] = batch.not_finite;
  double* cost = &out.cost[at * kRows];
  std::copy_n(batch.cost, batch.rows, cost);
  std::fill(cost + batch.rows, cost + kRows, 0.0);
  if (out.has_residuals && robust) std::copy_n(batch.weight, kRows, &out.weight[at * kRows]);
  const std::uint64_t counts = frozen != nullptr ? frozen->valid[at] : out.valid[at];
  if (counts == batch.valid) return;
  for (int l = 0; l < batch.rows; ++l) {
    if (!(counts >> l & 1))
      cost[l] = 0.0;
    else if (!(batch.valid >> l & 1))
      cost[l] = batch.not_finite >> l & 1 ? HUGE_VAL : frozen->cost[at * kRows + l];
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
    const std::int64_t ld = prior_product_.subtract(graph.priors().numbers(plan.row));
    for (std::size_t b = 0; b < plan.targets.size(); ++b)
      for (std::size_t a = b; a < plan.targets.size(); ++a) {
        const Target &x = plan.targets[a], &y = plan.targets[b];
        if (x.kind != Target::Kind::kept || y.kind != Target::Kind::kept) continue;
        const BlockAddress at = structure.address(x.index, y.index);
        const int rows = plan.columns[a + 1] - plan.columns[a], columns = plan.columns[b + 1] - plan.columns[b];
        const double* from = prior_product_.product.data() + plan.columns[b] * ld + plan.columns[a];
        for (int c = 0; c < columns; ++c)
          for (int r = a == b ? c : 0; r < rows; ++r)
            prior_h_.data()[at.offset + (at.transposed ? r * at.ld + c : c * at.ld + r)] -= from[c * ld + r];
      }
  }
  prior_h_structure_ = structure.version();
}

}  // namespace oriel
