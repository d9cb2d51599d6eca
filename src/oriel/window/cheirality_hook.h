// Takes out what cannot be seen from where it is said to be seen: factors that are not valid at the values with which
// they enter (a landmark behind its camera, or outside of what the camera's model covers), and landmarks that no factor
// is left for.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/window/factor_probe.h"
#include "oriel/window/insertion_hook.h"

namespace oriel {

class CheiralityHook final : public InsertionHook {
 public:
  // Of these sensors (SlidingWindow::add gives their numbers); none named: of all.
  explicit CheiralityHook(std::vector<int> sensors = {}) : sensors_(std::move(sensors)) {}

  std::string_view name() const override { return "cheirality"; }
  Verdict inserted(const Graph& graph, const States& states, const InsertedGroup& group, GraphEdit& edit) override;
  std::int64_t dropped() const { return dropped_; }  // factors, so far

 private:
  std::vector<int> sensors_;
  FactorProbe probe_;
  GroupPruner pruner_;
  std::int64_t dropped_ = 0;
};

}  // namespace oriel
