// A graph as a ceres::Problem that is kept: edits are taken over one by one, and nothing is made anew. It has values of
// its own, so that the graph changes only by what is adopted afterwards.
#pragma once
#include <ceres/ceres.h>

#include <memory>
#include <vector>

#include "oriel/engines/ceres/ceres_costs.h"
#include "oriel/solve/engine_contents.h"

namespace oriel::ceres_detail {

// Things by slot, each at an address of its own that does not change.
template <class T>
class SlotTable {
 public:
  T& add(SlotKey key) {
    if (things_.size() <= key.index) things_.resize(std::size_t{key.index} + 1);
    things_[key.index] = std::make_unique<T>();
    things_[key.index]->key = key;
    return *things_[key.index];
  }
  T* find(SlotKey key) const {
    T* thing = key.index < things_.size() ? things_[key.index].get() : nullptr;
    return thing != nullptr && thing->key == key ? thing : nullptr;
  }
  void erase(SlotKey key) { things_[key.index].reset(); }
  template <class F>
  void for_each(F&& f) const {
    for (const auto& thing : things_)
      if (thing) f(*thing);
  }

 private:
  std::vector<std::unique_ptr<T>> things_;
};

class CeresProblem {
 public:
  CeresProblem();
  CeresProblem(const CeresProblem&) = delete;
  CeresProblem& operator=(const CeresProblem&) = delete;

  // What a follower is told (Graph::collect), in the order of C4; what comes, in that of serials.
  void apply(const GraphEdit& net);
  // All of them: adopted values raise no flag for followers (C5).
  void take_values(const Graph& graph);

  ceres::Problem& problem() { return *problem_; }
  // ½Σρ(‖r‖²) at the values, factors that are not valid there left out.
  double cost();
  // Which factors count from now on, those that are valid at the values, and where Jacobians are taken. How many do not
  // count.
  std::int64_t freeze(bool first_estimates);
  void thaw();

  struct Size {
    int dim = 0;  // of what may move
    bool has_landmarks = false;
    std::int64_t factors = 0;  // priors included
  };
  Size size() const;
  // The values, for a graph that had this version when the solve began.
  Solution solution(std::uint64_t version) const;
  // Read back from the ceres::Problem; all but the cost.
  EngineContents contents() const;
  // Of variables that are in the graph; n the sum of their dimensions. False where Ceres finds the rank deficient.
  bool covariance(std::span<const VariableKey> ids, std::size_t n, std::vector<double>& out);

 private:
  struct Pool {
    explicit Pool(const VariableOps& o) : ops(&o), manifold(o) {}
    const VariableOps* ops;
    PoolManifold manifold;
    SlotTable<HeldVariable> variables;
  };
  // A factor or a prior.
  struct HeldFactor {
    SlotKey key;
    std::uint64_t serial = 0;
    std::unique_ptr<ceres::CostFunction> cost;
    FactorCost* factor = nullptr;     // the cost, unless it is a prior's
    std::unique_ptr<TableLoss> loss;  // none in a prior
    std::vector<double*> blocks;
    ceres::ResidualBlockId block = nullptr;
  };
  struct Table {
    std::uint64_t key = 0;
    SlotTable<HeldFactor> factors;
  };

  Pool* find_pool(std::uint64_t type) const;
  Pool& pool(const VariableOps& ops);
  Table& table(std::uint64_t key);
  HeldVariable* find(VariableKey id) const;

  void remove_factors(const GraphEdit& net);
  void remove_variables(const GraphEdit& net);
  void add_variables(const GraphEdit& net);
  void add_factors(const GraphEdit& net);
  void set_flags(const GraphEdit& net);
  void set_freedom(Pool& pool, HeldVariable& v, const Freedom& freedom);
  void add_variable(const edit::Variables& column, std::size_t i);
  void add_factor(const edit::Factors& column, std::size_t i);
  void add_prior(const edit::Priors& priors, std::size_t i);
  bool touches_all() const;
  Argument argument(VariableKey id, std::vector<double*>& blocks) const;

  Switches switches_;
  std::vector<std::unique_ptr<Pool>> pools_;
  std::vector<std::unique_ptr<Table>> tables_;  // that of the priors among them
  std::unique_ptr<ceres::Problem> problem_;     // after what it points to, so that it goes first
};

}  // namespace oriel::ceres_detail
