// A prior that ties some variables to the rest, taken apart: marginals of the same Gaussian.
#pragma once
#include <vector>

#include "oriel/window/absorbed_batch.h"

namespace oriel {

class PriorMarginal {
 public:
  // The rows of `joint` that are about the columns with `keeps`, the others marginalized; these are zero in `out`.
  void operator()(const SquareRootRows& joint, const std::vector<char>& keeps, SquareRootRows& out);

 private:
  std::vector<double> a_;
  std::vector<int> order_;
  std::vector<char> empty_;
};

}  // namespace oriel
