// The system at a point: every batch evaluated with its Jacobians and added, table by table; large tables slice by
// slice (structure_slices.cc), which several workers may share.
#include <algorithm>
#include <bit>

#include "oriel/linear/accumulate.h"
#include "oriel/linear/linearize.h"
#include "oriel/linear/plan_batches.h"

namespace oriel {
namespace {

constexpr std::size_t kRows = Batch::kRows;
constexpr std::size_t kTogether = 512;  // landmarks that a worker copies from at a time

// What the Jacobians of batch `at` say of which of its rows count; true if that changes anything.
bool note_jacobians(const Batch& batch, std::size_t at, ActiveSet& set) {
  const std::uint64_t was = set.no_jacobian[at], now = batch.not_finite & ~set.not_finite_mask[at];
  if (now == was) [[likely]]
    return false;
  set.no_jacobian[at] = now;
  for (int l = 0; l < batch.rows; ++l)
    if ((now ^ was) >> l & 1u) set.cost[at * kRows + static_cast<std::size_t>(l)] = batch.cost[l];  // 0 without one
  set.valid[at] = (set.valid[at] & ~now) | (batch.valid & was & ~now);
  return true;
}

}  // namespace

void Linearizer::linearize(const Graph& graph, const LinearStructure& structure, const Point& point, ActiveSet* active,
                           LinearSystem& out, TaskPool* pool) {
  lay_out(structure, pool);
  clear(graph, structure, out);
  add_prior_gradients(graph, structure, point, out);
  Finding all;
  Place place;
  for (std::size_t t = 0; t < structure.plan_count(); ++t) {
    place.plan = t;
    const TablePlan& plan = structure.plans()[t];
    if (plan.slices.empty()) {
      add_batches(graph, structure, point, active, place, batches_of(plan), scratch_[0].data(), out, all);
    } else {
      add_slices(graph, structure, point, active, place, out, pool);
      for (const Finding& f : findings_) {
        all.not_finite += f.not_finite;
        all.fallbacks += f.fallbacks;
        all.changed |= f.changed;
      }
    }
    place.before += batches_of(plan);
    place.residuals += doubles_of(plan, false) * static_cast<std::int64_t>(batches_of(plan));
  }
  not_finite_ = all.not_finite;
  kernel_fallbacks_ += all.fallbacks;
  if (all.changed) add_up(structure, *active);
  copy_diagonal(structure, out, pool);
}

void Linearizer::lay_out(const LinearStructure& structure, TaskPool* pool) {
  std::int64_t largest = 0;
  for (std::size_t t = 0; t < structure.plan_count(); ++t)
    largest = std::max(largest, doubles_of(structure.plans()[t], true));
  const std::size_t workers = pool == nullptr ? 1 : static_cast<std::size_t>(pool->workers());
  if (scratch_.size() < workers) scratch_.resize(workers);
  for (AlignedBuffer& s : scratch_) s.reserve(largest);
  pack_measurements(structure);
}

void Linearizer::clear(const Graph& graph, const LinearStructure& structure, LinearSystem& out) {
  const std::int64_t h = structure.factorization().storage_size();
  out.h.reserve(structure.hessian_size());
  out.landmarks.reserve(structure.landmark_store());
  if (structure.prior_count() > 0) {
    if (prior_h_structure_ != structure.version()) sum_prior_hessians(graph, structure);
    std::copy_n(prior_h_.data(), h, out.h.data());
  } else {
    std::fill_n(out.h.data(), h, 0.0);
  }
  if (!structure.slices_clear_landmarks()) std::fill_n(out.landmarks.data(), structure.landmark_store(), 0.0);
  out.gradient.assign(static_cast<std::size_t>(structure.dim()), 0.0);
}

// Batches [place.index, end) of a plan.
void Linearizer::add_batches(const Graph& graph, const LinearStructure& structure, const Point& point,
                             ActiveSet* active, Place place, std::size_t end, double* scratch, LinearSystem& out,
                             Finding& finding) const {
  const TablePlan& plan = structure.plans()[place.plan];
  double* const r = scratch;
  double* const j = r + doubles_of(plan, false);
  for (; place.index < end; ++place.index) {
    Batch batch;
    run_batch(graph, plan, point, place, active, r, j, batch);
    finding.not_finite += std::popcount(batch.not_finite);
    if (active != nullptr) finding.changed |= note_jacobians(batch, place.before + place.index, *active);
    accumulate(structure, plan, place.index * kRows, batch, out, finding.fallbacks);
  }
}

void Linearizer::add_slices(const Graph& graph, const LinearStructure& structure, const Point& point, ActiveSet* active,
                            const Place& place, LinearSystem& out, TaskPool* pool) {
  const TablePlan& plan = structure.plans()[place.plan];
  findings_.assign(plan.slices.size(), {});
  parallel_for(pool, static_cast<int>(plan.slices.size()), [&](int k, int worker) {
    const TablePlan::Slice& slice = plan.slices[static_cast<std::size_t>(k)];
    std::fill(out.h.data() + slice.partial_begin, out.h.data() + slice.partial_end, 0.0);
    std::fill(out.landmarks.data() + slice.clear_begin, out.landmarks.data() + slice.clear_end, 0.0);
    Place first = place;
    first.index = slice.first;
    add_batches(graph, structure, point, active, first, slice.last, scratch_[static_cast<std::size_t>(worker)].data(),
                out, findings_[static_cast<std::size_t>(k)]);
  });
  add_partials(plan, out);
}

void Linearizer::add_partials(const TablePlan& plan, LinearSystem& out) {
  for (const TablePlan::PartialSum& p : plan.partials) {
    const double* from = out.h.data() + p.from;
    double* const to = out.h.data() + p.to;
    const bool diagonal = p.gradient >= 0;
    for (std::int64_t c = 0; c < p.columns; ++c)
      for (std::int64_t r = diagonal ? c : 0; r < p.rows; ++r) to[c * p.ld + r] += *from++;
    if (!diagonal) continue;
    from = out.h.data() + p.from + packed_half(p.rows);
    for (std::int32_t r = 0; r < p.rows; ++r) out.gradient[static_cast<std::size_t>(p.gradient + r)] += from[r];
  }
}

// The diagonal of H and V, and what was summed of the gradient beside each V.
void Linearizer::copy_diagonal(const LinearStructure& structure, LinearSystem& out, TaskPool* pool) {
  out.diagonal.resize(static_cast<std::size_t>(structure.dim()));
  const auto& kept = structure.kept();
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const BlockAddress at = structure.address(static_cast<int>(i), static_cast<int>(i));
    for (int k = 0; k < kept[i].dim; ++k)
      out.diagonal[static_cast<std::size_t>(kept[i].offset + k)] =
          out.h.data()[at.offset + std::int64_t{k} * at.ld + k];
  }
  const auto& landmarks = structure.landmarks();
  parallel_for(pool, static_cast<int>((landmarks.size() + kTogether - 1) / kTogether), [&](int task, int) {
    const std::size_t first = static_cast<std::size_t>(task) * kTogether;
    for (std::size_t i = first; i < std::min(first + kTogether, landmarks.size()); ++i) {
      const LandmarkBlock& l = landmarks[i];
      for (int k = 0; k < l.dim; ++k) {
        out.diagonal[static_cast<std::size_t>(l.offset + k)] = out.landmarks.data()[l.v() + k * l.dim + k];
        out.gradient[static_cast<std::size_t>(l.offset + k)] += out.landmarks.data()[l.g() + k];
      }
    }
  });
}

}  // namespace oriel
