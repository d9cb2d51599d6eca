// Which kept variables are connected, and by what the reduced system is solved: formed and factored, or products alone.
#include <algorithm>

#include "oriel/linear/structure.h"

namespace oriel {
namespace {

constexpr int kSmallTable = 160;  // kept blocks up to which addresses of all pairs are tabulated
constexpr int kGivenOrder = 96;   // kept blocks up to which a problem with landmarks needs no ordering search
// What the choice between a direct solve and conjugate gradients goes by. Rough: rates as they are seen on bundle
// adjustments, the number of products a guess; what matters is that sizes alone decide.
constexpr double kIterations = 50.0;      // of conjugate gradients a step
constexpr double kFlopsPerSecond = 20e9;  // of elimination and factorization
constexpr double kBytesPerSecond = 6e9;   // of W in a product
constexpr double kMostPairs = 3e7;        // sightings of one landmark by two, up to which the pattern is looked at
constexpr double kLongStep = 0.25;        // [s] of a direct step, below which there is nothing to choose: it is exact

}  // namespace

void LinearStructure::connect(int i, int j) {
  if (connected_.empty()) {
    pattern_.connect(i, j);
    return;
  }
  char& c = connected_[static_cast<std::size_t>(i) * kept_.size() + j];
  if (c) return;
  c = 1;
  pattern_.connect(i, j);
}

// What shares a factor or a prior.
void LinearStructure::connect_rows() {
  for (std::size_t i = 0; i < plan_count_; ++i) {
    const TablePlan& plan = plans_[i];
    const std::size_t n = plan.arguments.size();
    if (n < 2) continue;
    for (std::size_t r = 0; r < plan.rows.size(); ++r) {
      if (forms_reduced_ && plan.landmark[r] >= 0) continue;  // its neighbours are connected below
      for (std::size_t a = 1; a < n; ++a)
        for (std::size_t b = 0; b < a; ++b) {
          const Target &x = plan.targets[r * n + a], &y = plan.targets[r * n + b];
          if (x.kind == Target::Kind::kept && y.kind == Target::Kind::kept) connect(x.index, y.index);
        }
    }
  }
  for (std::size_t i = 0; i < prior_count_; ++i)
    for (const Target& x : priors_[i].targets)
      for (const Target& y : priors_[i].targets)
        if (x.kind == Target::Kind::kept && y.kind == Target::Kind::kept && x.index > y.index)
          connect(x.index, y.index);
}

// What sees the same landmark.
void LinearStructure::connect_neighbours() {
  if (seen_by_.empty()) {
    for (const LandmarkBlock& l : landmarks_)
      for (int a = 1; a < l.neighbours; ++a)
        for (int b = 0; b < a; ++b) connect(neighbours_[l.first_neighbour + a], neighbours_[l.first_neighbour + b]);
    return;
  }
  for (int k = 0; k < static_cast<int>(kept_.size()) - first_seen_; ++k) {
    std::uint64_t with = 0;
    for (const std::uint64_t seen : seen_by_) with |= seen >> k & 1 ? seen : 0;
    for (int i = 0; i < k; ++i)
      if (with >> i & 1) connect(first_seen_ + k, first_seen_ + i);
  }
}

void LinearStructure::find_pattern() {
  dims_.clear();
  for (const KeptBlock& b : kept_) dims_.push_back(b.dim);
  pattern_.reset(dims_);
  connected_.clear();
  if (kept_.size() <= kSmallTable) connected_.assign(kept_.size() * kept_.size(), 0);
  connect_rows();
  if (forms_reduced_) connect_neighbours();
  pattern_.finish();
}

// What one step by conjugate gradients takes, by the bytes of W that each of its products reads.
double LinearStructure::iterative_seconds() const {
  return kIterations * 8.0 * static_cast<double>(landmark_store_) / kBytesPerSecond;
}

// Whether the pattern of the reduced system is worth a look.
bool LinearStructure::may_form_reduced() const {
  double pairs = 0.0;
  for (const LandmarkBlock& l : landmarks_) pairs += 0.5 * l.neighbours * (l.neighbours - 1);
  return pairs < kMostPairs;
}

Result<void> LinearStructure::factorize(const FactorOptions& options) {
  FactorOptions chosen = options;
  order_.clear();
  if (!landmarks_.empty() && kept_.size() <= kGivenOrder && options.ordering == OrderingMethod::automatic) {
    chosen.ordering = OrderingMethod::given;
    for (std::size_t i = 0; i < kept_.size(); ++i) order_.push_back(static_cast<int>(i));
  }
  return factorization_.analyze(pattern_, chosen, order_);
}

Result<void> LinearStructure::analyze(const FactorOptions& options) {
  const bool may_choose = options.linear_solver == LinearSolver::automatic && !landmarks_.empty();
  const double n = kept_dim_, dense_seconds = (landmark_flops_ + n * n * n / 3.0) / kFlopsPerSecond;
  const double bound = std::max(kLongStep, iterative_seconds());
  is_large_ = !landmarks_.empty() && dense_seconds > bound;
  forms_reduced_ = landmarks_.empty() || options.linear_solver != LinearSolver::conjugate_gradient;
  if (may_choose && is_large_ && !may_form_reduced()) forms_reduced_ = false;
  find_pattern();
  if (auto ok = factorize(options); !ok) return ok;
  const double seconds = (landmark_flops_ + factorization_.symbolic().flops()) / kFlopsPerSecond;
  if (may_choose && is_large_ && forms_reduced_ && seconds > bound) {
    forms_reduced_ = false;
    find_pattern();
    if (auto ok = factorize(options); !ok) return ok;
  }
  tabulate();
  return {};
}

// Addresses of all pairs, where those are few.
void LinearStructure::tabulate() {
  small_table_.clear();
  if (connected_.empty() || kept_.empty()) return;
  const std::size_t n = kept_.size();
  small_table_.resize(n * n);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      if (i != j && connected_[i * n + j] == 0 && connected_[j * n + i] == 0) continue;
      BlockAddress at = factorization_.address(static_cast<int>(i), static_cast<int>(j));
      small_table_[i * n + j] = at;
      at.transposed = at.transposed != (i != j);
      small_table_[j * n + i] = at;
    }
}

}  // namespace oriel
