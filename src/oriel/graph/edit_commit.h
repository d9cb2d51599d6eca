// Makes a validated edit part of the graph. Nothing here can fail but memory, which is reserved first.
#pragma once
#include "oriel/graph/graph.h"

namespace oriel {

class EditCommit {
 public:
  EditCommit(Graph& graph, GraphEdit& edit) : g_(graph), edit_(edit) {}
  // Order (C4): factors out, variables out, variables in, factors in, values and flags.
  void run();

 private:
  void resolve();
  void resolve_references();
  void give_serials();
  void derive_priors();
  bool leaves(const VariableRef& ref) const;
  void derive_prior(std::uint32_t row);
  void take_known(std::uint32_t row, int rows);
  void reserve();
  void remove_factors();
  void remove_variables();
  void claim();
  void add_variables();
  void add_factors();
  void add_priors(edit::Priors& priors);
  void set_values();
  void set_losses();
  void set_freedom(VariablePool& pool, std::uint32_t dense, const Freedom& freedom);
  void remove_factor(std::uint32_t table, SlotKey key);
  void remove_prior(SlotKey key);
  void attach(VariablePool& pool, std::uint32_t dense, std::uint32_t& entry, std::uint32_t table, std::uint32_t slot,
              std::uint32_t arg);
  void detach(const VariableRef& ref, std::uint32_t entry);
  void set_first_estimates(std::uint32_t row);
  void note_change(const VariablePool& pool, std::uint32_t dense);
  bool changes_structure() const;
  bool changes_fixed(const edit::Variables& c) const;

  Graph& g_;
  GraphEdit& edit_;
};

}  // namespace oriel
