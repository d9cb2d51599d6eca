// The linear problem at a point: costs, gradient, H, and the blocks of landmarks.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/linear/aligned_buffer.h"
#include "oriel/linear/point.h"
#include "oriel/linear/prior_product.h"
#include "oriel/linear/structure.h"
#include "oriel/linear/task_pool.h"

namespace oriel {

// H (kept with kept, in the layout of the factorization), g = Jᵀr (kept, then landmarks), and for each landmark V, g,
// W.
struct LinearSystem {
  AlignedBuffer h;               // behind H: partial sums, which are added to it (structure_slices.cc)
  std::vector<double> gradient;  // of the cost by the step, dim() values; those of landmarks too
  AlignedBuffer landmarks;
  std::vector<double> diagonal;  // of the whole H, dim() values
};

// Which factors count, and what each costs, at one point (decision 12).
struct ActiveSet {
  std::vector<std::uint64_t> valid, not_finite_mask;  // a batch each
  // A batch each: rows whose Jacobian was not finite at the last linearization, though r was. They do not count until a
  // linearization finds one that is.
  std::vector<std::uint64_t> no_jacobian;
  std::vector<double> cost;  // ½ρ by row, 64 a batch
  // Where Jacobians may be taken elsewhere (decision 9): r and √ρ' of all batches, one after the other. Else empty.
  AlignedBuffer residuals;
  std::vector<double> weight;
  bool has_residuals = false;
  double prior_cost = 0.0;
  double total = 0.0;
  std::int64_t invalid = 0, not_finite = 0;  // rows; not finite: r or the Jacobian
};

class Linearizer {
 public:
  // Jacobians at first estimates where there are any (decision 9).
  bool first_estimates = true;

  // What every factor costs at the point. With `frozen`, its factors count and no others: one that is invalid here is
  // charged what it cost there.
  void evaluate(const Graph& graph, const LinearStructure& structure, const Point& point, const ActiveSet* frozen,
                ActiveSet& out, TaskPool* pool);

  // The same at a point that was accepted, where the set freezes anew: what is known of its Jacobians stays.
  void refresh(const Graph& graph, const LinearStructure& structure, const Point& point, ActiveSet& set,
               TaskPool* pool);

  // The system at the point, over the factors that are valid there. `active`, unless null, is the set at this point:
  // what it knows of residuals is not evaluated again; rows that turn out to have no finite Jacobian leave it, and
  // those that have one again come back.
  void linearize(const Graph& graph, const LinearStructure& structure, const Point& point, ActiveSet* active,
                 LinearSystem& out, TaskPool* pool);

  std::int64_t kernel_fallbacks() const { return kernel_fallbacks_; }
  // Rows whose residual or Jacobian was not finite at the last linearization.
  std::int64_t not_finite() const { return not_finite_; }

 private:
  // Batch `index` of a plan; before it stand `before` batches of other plans, whose residuals take up `residuals`
  // doubles.
  struct Place {
    std::size_t plan = 0, index = 0, before = 0;
    std::int64_t residuals = 0;
  };
  struct Packed {
    AlignedBuffer numbers;
    std::size_t packs = 0;  // of a group of eight rows
  };
  void pack_measurements(const LinearStructure& structure);
  void lay_out(const LinearStructure& structure, TaskPool* pool);
  void lay_out(const Graph& graph, const LinearStructure& structure, ActiveSet& out);
  void sum_costs(const Graph& graph, const LinearStructure& structure, const Point& point, const ActiveSet* frozen,
                 ActiveSet& out, TaskPool* pool);
  static void add_up(const LinearStructure& structure, ActiveSet& set);
  static void keep(const Batch& batch, bool robust, std::size_t at, const ActiveSet* frozen, ActiveSet& out);
  void run_batch(const Graph& graph, const TablePlan& plan, const Point& point, const Place& place,
                 const ActiveSet* evaluated, double* r, double* j, Batch& batch) const;
  double prior_cost(const Graph& graph, const LinearStructure& structure, const Point& point);
  void add_prior_gradients(const Graph& graph, const LinearStructure& structure, const Point& point, LinearSystem& out);
  void sum_prior_hessians(const Graph& graph, const LinearStructure& structure);
  void prior_error(const Graph& graph, const PriorPlan& plan, const Point& point);
  void clear(const Graph& graph, const LinearStructure& structure, LinearSystem& out);
  // What a range of batches found beside its sums.
  struct Finding {
    std::int64_t not_finite = 0, fallbacks = 0;
    bool changed = false;  // of the active set
  };
  void add_batches(const Graph& graph, const LinearStructure& structure, const Point& point, ActiveSet* active,
                   Place place, std::size_t end, double* scratch, LinearSystem& out, Finding& finding) const;
  void add_slices(const Graph& graph, const LinearStructure& structure, const Point& point, ActiveSet* active,
                  const Place& place, LinearSystem& out, TaskPool* pool);
  static void add_partials(const TablePlan& plan, LinearSystem& out);
  static void copy_diagonal(const LinearStructure& structure, LinearSystem& out, TaskPool* pool);

  std::vector<Packed> packed_;  // by plan
  std::uint64_t packed_structure_ = 0;
  std::vector<AlignedBuffer> scratch_;    // one a worker: r and J of a batch
  std::vector<Finding> findings_;         // one a slice
  std::vector<double> error_, residual_;  // of a prior
  PriorProduct prior_product_;
  AlignedBuffer prior_h_;  // RᵀR of all priors: a cache, made once a structure
  std::uint64_t prior_h_structure_ = 0;
  std::int64_t kernel_fallbacks_ = 0, not_finite_ = 0;
};

}  // namespace oriel
