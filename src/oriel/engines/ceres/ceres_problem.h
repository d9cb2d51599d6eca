// A graph as a ceres::Problem, with values of its own: the graph changes only by what is adopted afterwards.
#pragma once
#include <ceres/ceres.h>

#include <memory>
#include <unordered_map>
#include <vector>

#include "oriel/engines/ceres/ceres_costs.h"
#include "oriel/solve/engine_contents.h"

namespace oriel::ceres_detail {

class CeresProblem {
 public:
  CeresProblem(const Graph& graph, bool first_estimates);
  CeresProblem(const CeresProblem&) = delete;
  CeresProblem& operator=(const CeresProblem&) = delete;

  ceres::Problem& problem() { return *problem_; }
  // ½Σρ(‖r‖²) at the values, factors that are not valid there left out.
  double cost();
  // Which factors count from now on: those that are valid at the values.
  void freeze();
  bool has_landmarks() const { return has_landmarks_; }
  std::int64_t invalid() const { return invalid_; }
  std::int64_t factors() const { return static_cast<std::int64_t>(residuals_.size()); }
  int dim() const { return dim_; }
  Solution solution(const Graph& graph) const;
  // Read back from the ceres::Problem; all but the cost.
  EngineContents contents(const Graph& graph) const;

 private:
  void add_variables(const Graph& graph);
  void add_factors(const Graph& graph, bool first_estimates);
  void add_priors(const Graph& graph);
  Argument argument(const Graph& graph, const VariableRef& ref, bool first_estimates,
                    std::vector<double*>& blocks) const;
  ceres::LossFunction* loss(const Loss& loss);

  struct Factor {
    FactorCost* cost;
    std::vector<double*> blocks;
  };
  std::vector<std::vector<double>> values_;               // by pool: block_size doubles a variable, by dense position
  std::vector<std::unique_ptr<PoolManifold>> manifolds_;  // by pool
  std::vector<std::unique_ptr<ceres::LossFunction>> losses_;
  std::unique_ptr<ceres::Problem> problem_;  // after what it points to, so that it goes first
  std::vector<Factor> factors_;
  std::unordered_map<ceres::ResidualBlockId, FactorId> residuals_;  // priors included
  std::int64_t invalid_ = 0;
  int dim_ = 0;
  bool has_landmarks_ = false;
};

}  // namespace oriel::ceres_detail
