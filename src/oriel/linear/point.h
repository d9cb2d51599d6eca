// Values of all variables of a graph, apart from the graph: what an engine works on, so that a solve that fails has
// changed nothing and several engines may follow one graph.
#pragma once
#include <vector>

#include "oriel/graph/graph.h"

namespace oriel {

class Point {
 public:
  // Takes over the graph's values, column by column. Dense positions are those of its pools.
  void take(const Graph& graph) {
    const auto& pools = graph.pools();
    for (std::size_t p = columns_.size(); p < pools.size(); ++p) columns_.emplace_back(pools[p]->ops().bytes);
    for (std::size_t p = 0; p < pools.size(); ++p) {
      columns_[p].resize(pools[p]->extent());
      if (pools[p]->extent() > 0)
        std::memcpy(columns_[p].data(), pools[p]->values(), pools[p]->extent() * columns_[p].stride());
    }
  }
  const std::byte* column(std::size_t pool) const { return columns_[pool].data(); }
  std::byte* column(std::size_t pool) { return columns_[pool].data(); }
  const void* value(std::size_t pool, std::uint32_t dense) const { return columns_[pool].at(dense); }
  void* value(std::size_t pool, std::uint32_t dense) { return columns_[pool].at(dense); }

 private:
  std::vector<ByteColumn> columns_;
};

}  // namespace oriel
