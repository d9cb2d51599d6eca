#include "oriel/window/untie.h"

#include <algorithm>

#include "oriel/window/echelon.h"

namespace oriel {

void PriorMarginal::operator()(const SquareRootRows& joint, const std::vector<char>& keeps, SquareRootRows& out) {
  const auto rows = static_cast<std::size_t>(joint.rows);
  order_.clear();
  for (const char keep : {0, 1})
    for (int c = 0; c < joint.cols; ++c)
      if ((keeps[c] != 0) == (keep != 0)) order_.push_back(c);
  const auto gone = static_cast<int>(std::count(keeps.begin(), keeps.end(), 0));
  a_.clear();
  for (const int c : order_) {
    const auto from = joint.R.begin() + static_cast<std::ptrdiff_t>(rows * static_cast<std::size_t>(c));
    a_.insert(a_.end(), from, from + joint.rows);
  }
  a_.insert(a_.end(), joint.d.begin(), joint.d.end());
  empty_.assign(order_.size(), 0);
  const StackedColumns a{a_.data(), rows, joint.rows};
  const int used = reduce_to_echelon(a, 0, gone, joint.cols + 1, 0, empty_.data());
  out.rows = reduce_to_echelon(a, gone, joint.cols, joint.cols + 1, used, empty_.data()) - used, out.cols = joint.cols;
  forget_rounding(a, gone, joint.cols, used, joint.rows);
  out.R.assign(static_cast<std::size_t>(out.rows) * static_cast<std::size_t>(out.cols), 0.0);
  for (int i = gone; i < joint.cols; ++i)
    std::copy_n(a.column(i) + used, out.rows, out.R.begin() + static_cast<std::ptrdiff_t>(order_[i]) * out.rows);
  out.d.assign(a.column(joint.cols) + used, a.column(joint.cols) + used + out.rows);
}

}  // namespace oriel
