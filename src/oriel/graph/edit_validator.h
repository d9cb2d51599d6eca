// Everything that may be wrong with an edit, found before anything changes.
#pragma once
#include "oriel/graph/graph.h"

namespace oriel {

class EditValidator {
 public:
  // `marks` is scratch, empty before and after: ids may have been given elsewhere, whoever lent the edit.
  EditValidator(const Graph& graph, const GraphEdit& edit, edit::SlotMarks& marks)
      : graph_(graph), edit_(edit), marks_(marks) {}
  Result<void> validate() const;

 private:
  Result<void> variables(const edit::Variables& c) const;
  Result<void> added_variables(const edit::Variables& c) const;
  Result<void> factors(const edit::Factors& c) const;
  Result<void> added_factors(const edit::Factors& c, const SlotIndex& slots) const;
  Result<void> factor(const edit::Factors& c, std::size_t i) const;
  Result<void> priors() const;
  Result<void> prior(const edit::AddedPrior& p) const;
  Result<void> prior_numbers(const edit::AddedPrior& p, std::size_t estimates) const;
  // Will the variable be there when the edit is done? Else says why not.
  Result<void> resolves(const VariableOps& ops, SlotKey key, const std::string& what) const;

  const Graph& graph_;
  const GraphEdit& edit_;
  edit::SlotMarks& marks_;
};

}  // namespace oriel
