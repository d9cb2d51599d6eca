// What the native engine holds, read back from the layout of its linear problem and its point, not from the graph.
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

class Reader {
 public:
  Reader(const Graph& graph, const LinearStructure& structure) : graph_(graph), structure_(structure) {}

  template <class Block>
  VariableKey id(const Block& block) const {
    const VariablePool& pool = *graph_.pools()[block.pool];
    return {pool.ops().key, pool.slots().key(block.dense)};
  }
  template <class Block>
  EngineContents::Parameter parameter(const Block& block, const Point& point, const Restriction& restriction) const {
    const auto* value = static_cast<const std::byte*>(point.value(block.pool, block.dense));
    return {id(block),
            block.dim,
            {value, value + graph_.pools()[block.pool]->ops().bytes},
            restriction.freedom(block.offset)};
  }
  void append(const Target& target, EngineContents::Residual& residual) const {
    const auto index = static_cast<std::size_t>(target.index);
    if (target.kind == Target::Kind::kept) residual.add(id(structure_.kept()[index]));
    if (target.kind == Target::Kind::landmark) residual.add(id(structure_.landmarks()[index]));
  }
  // Rows that only fill up a batch are left out.
  void residuals(const TablePlan& plan, EngineContents& out) const {
    const std::size_t n = plan.arguments.size();
    const FactorTable& table = *plan.table;
    for (std::size_t r = 0; r < plan.rows.size(); ++r) {
      if ((plan.active[r / Batch::kRows] >> r % Batch::kRows & 1u) == 0) continue;
      EngineContents::Residual residual{{table.ops().key, table.slots().key(plan.rows[r])}, table.ops().dim, {}};
      for (std::size_t a = 0; a < n; ++a) append(plan.targets[r * n + a], residual);
      out.residuals.push_back(std::move(residual));
    }
  }
  void residual(const PriorPlan& plan, EngineContents& out) const {
    const PriorTable& priors = graph_.priors();
    EngineContents::Residual residual{
        {PriorTable::kKey, priors.slots().key(plan.row)}, priors.numbers(plan.row).rows, {}};
    for (const Target& target : plan.targets) append(target, residual);
    out.residuals.push_back(std::move(residual));
  }

 private:
  const Graph& graph_;
  const LinearStructure& structure_;
};

}  // namespace

Result<EngineContents> NativeEngine::contents() noexcept {
  if (auto ok = linearize(false); !ok) return ok.error();
  EngineContents out;
  const Reader read(*graph_, structure_);
  for (const KeptBlock& b : structure_.kept()) out.parameters.push_back(read.parameter(b, point_, restriction_));
  for (const LandmarkBlock& b : structure_.landmarks())
    out.parameters.push_back(read.parameter(b, point_, restriction_));
  for (std::size_t t = 0; t < structure_.plan_count(); ++t) read.residuals(structure_.plans()[t], out);
  for (std::size_t i = 0; i < structure_.prior_count(); ++i) read.residual(structure_.priors()[i], out);
  out.cost = active_.total;
  return out;
}

}  // namespace oriel
