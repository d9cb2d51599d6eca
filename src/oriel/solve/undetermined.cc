// What nothing determines: null directions of the undamped linear system, by name.
//
// A pivot that is rounding error marks a scalar j that the rest does not determine: one below 1e-10 of the diagonal of
// H before landmarks were eliminated, since that is the size of what was subtracted (on the problems of tests/solve/
// gauge_test.cc null pivots are below 1e-12 and all others above 1e-5). With those scalars held, the rest answers x to
// the move e_j; n = e_j + x then has H n = 0 up to rounding, and its largest parts are what to tell.
#include <algorithm>
#include <cmath>

#include "oriel/solve/minimizer.h"

namespace oriel {
namespace {

constexpr std::size_t kMostDirections = 24;
constexpr std::size_t kMostScalars = 4;  // named for one direction
constexpr double kNullPivot = 1e-10;     // of the diagonal of H
constexpr double kHidden = 1e4;          // times λ: pivots up to there may be null ones that damping hides
constexpr double kHold = 1e8;            // times the diagonal: what holds a scalar

// What hangs together: variables that share a factor or a prior, through landmarks too. Blocks are numbered kept ones
// first, then landmarks.
class Components {
 public:
  explicit Components(const LinearStructure& s) : kept_(static_cast<int>(s.kept().size())) {
    parent_.resize(s.kept().size() + s.landmarks().size());
    for (std::size_t i = 0; i < parent_.size(); ++i) parent_[i] = static_cast<int>(i);
    for (std::size_t t = 0; t < s.plan_count(); ++t) {
      const TablePlan& plan = s.plans()[t];
      const std::size_t n = plan.arguments.size();
      for (std::size_t r = 0; r < plan.rows.size(); ++r) join({plan.targets.data() + r * n, n});
    }
    for (std::size_t i = 0; i < s.prior_count(); ++i) join(s.priors()[i].targets);
  }
  int find(int i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }

 private:
  void join(std::span<const Target> targets) {
    int first = -1;
    for (const Target& t : targets) {
      if (t.kind == Target::Kind::fixed) continue;
      const int block = find(t.kind == Target::Kind::kept ? t.index : kept_ + t.index);
      if (first < 0) first = block;
      parent_[block] = first;
    }
  }
  int kept_;
  std::vector<int> parent_;
};

// Directions by name, and which of them are common. Of a direction that turns or shifts a whole, most variables of some
// type that hang together move (all poses of a shifted window, though no velocity); of one that is missing something,
// only few of each.
class Namer {
 public:
  Namer(const Graph& graph, const LinearStructure& structure, const std::vector<double>& diagonal)
      : graph_(graph), structure_(structure), diagonal_(diagonal), components_(structure) {}

  UndeterminedDirection name(const std::vector<double>& n) {
    UndeterminedDirection direction;
    // The parts of kept variables name a direction; landmarks follow them.
    const auto kept = static_cast<std::size_t>(structure_.kept_dim());
    double most = largest_part(n, 0, kept);
    const bool landmarks_alone = most == 0.0;
    if (landmarks_alone) most = largest_part(n, kept, n.size());
    std::vector<int> order;
    for (std::size_t i = landmarks_alone ? kept : 0; i < (landmarks_alone ? n.size() : kept); ++i)
      if (std::fabs(n[i]) >= 0.1 * most) order.push_back(static_cast<int>(i));
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return std::fabs(n[a]) > std::fabs(n[b]); });
    order.resize(std::min(order.size(), kMostScalars));
    for (const int i : order) {
      std::uint32_t pool = 0, dense = 0;
      int within = 0;
      structure_.locate(i, pool, dense, within);
      const VariablePool& p = *graph_.pools()[pool];
      direction.scalars.push_back({{p.ops().key, p.slots().key(dense)}, within});
    }
    const std::vector<bool>& moves = moved(n);
    direction.variables = static_cast<std::size_t>(std::count(moves.begin(), moves.end(), true));
    return direction;
  }

  bool is_common(const std::vector<double>& n) {
    const std::vector<bool>& moves = moved(n);
    const auto first = std::find(moves.begin(), moves.end(), true);
    if (std::count(first, moves.end(), true) < 2) return false;
    const int component = components_.find(static_cast<int>(first - moves.begin()));
    std::vector<std::int64_t> all(graph_.pools().size()), moving(all.size());
    for (std::size_t i = 0; i < moves.size(); ++i) {
      if (components_.find(static_cast<int>(i)) != component) continue;
      ++all[pool_of(i)];
      moving[pool_of(i)] += moves[i];
    }
    for (std::size_t p = 0; p < all.size(); ++p)
      if (moving[p] > 1 && 2 * moving[p] > all[p]) return true;
    return false;
  }

 private:
  static double largest_part(const std::vector<double>& n, std::size_t from, std::size_t to) {
    double most = 0.0;
    for (std::size_t i = from; i < to; ++i) most = std::max(most, std::fabs(n[i]));
    return most;
  }
  std::uint32_t pool_of(std::size_t block) const {
    const auto& kept = structure_.kept();
    return block < kept.size() ? kept[block].pool : structure_.landmarks()[block - kept.size()].pool;
  }
  // Which blocks move, by what residuals feel of it: a radian and the metre of a far point are not to be compared.
  const std::vector<bool>& moved(const std::vector<double>& move) {
    std::vector<double> n(move.size());
    for (std::size_t i = 0; i < n.size(); ++i) n[i] = move[i] * (diagonal_[i] > 0.0 ? std::sqrt(diagonal_[i]) : 1.0);
    const double least = 1e-6 * largest_part(n, 0, n.size());
    moved_.clear();
    auto add = [&](const auto& block) {
      const auto offset = static_cast<std::size_t>(block.offset);
      moved_.push_back(largest_part(n, offset, offset + static_cast<std::size_t>(block.dim)) > least);
    };
    for (const KeptBlock& b : structure_.kept()) add(b);
    for (const LandmarkBlock& b : structure_.landmarks()) add(b);
    return moved_;
  }

  const Graph& graph_;
  const LinearStructure& structure_;
  const std::vector<double>& diagonal_;
  Components components_;
  std::vector<bool> moved_;
};

// Is a pivot of V (n × n, lower half, column-major) rounding error?
bool is_weak(const double* v, int n) {
  constexpr double kRelativePivot = 1e-13;  // that of the elimination
  double l[3][3] = {};
  for (int j = 0; j < n; ++j) {
    const double diagonal = v[j * n + j];
    double pivot = diagonal;
    for (int k = 0; k < j; ++k) pivot -= l[j][k] * l[j][k];
    if (!(pivot > kRelativePivot * diagonal)) return true;
    l[j][j] = std::sqrt(pivot);
    for (int i = j + 1; i < n; ++i) {
      double s = v[j * n + i];
      for (int k = 0; k < j; ++k) s -= l[i][k] * l[j][k];
      l[i][j] = s / l[j][j];
    }
  }
  return false;
}

}  // namespace

// Damping hides what nothing determines; for landmarks it is looked for without, once a solve.
bool Minimizer::has_weak_landmark() const {
  const auto& landmarks = e_.structure_.landmarks();
  return std::any_of(landmarks.begin(), landmarks.end(),
                     [this](const LandmarkBlock& l) { return is_weak(e_.system_.landmarks.data() + l.v(), l.dim); });
}

// f(place in elimination, place in a step, pivot of the last factorization, diagonal of H) for each kept scalar; the
// pivot of one that was left out is 0.
template <class F>
void Minimizer::for_each_pivot(F f) const {
  const Multifrontal& factorization = e_.structure_.factorization();
  const auto& kept = e_.structure_.kept();
  for (std::size_t b = 0; b < kept.size(); ++b)
    for (int k = 0; k < kept[b].dim; ++k) {
      const int scalar = factorization.symbolic().scalar(static_cast<int>(b)) + k, at = kept[b].offset + k;
      const double inverse = factorization.inverse_diagonal()[static_cast<std::size_t>(scalar)];
      f(scalar, at, inverse > 0.0 ? 1.0 / (inverse * inverse) : 0.0, e_.system_.diagonal[static_cast<std::size_t>(at)]);
    }
}

// Where the pivot of the last factorization is the smallest share of the diagonal of H (see above), and that share.
std::pair<int, double> Minimizer::smallest_pivot() const {
  std::pair<int, double> least{-1, 1.0};
  for_each_pivot([&](int, int at, double pivot, double diagonal) {
    const double share = diagonal > 0.0 ? pivot / diagonal : 0.0;
    if (share < least.second) least = {at, share};
  });
  return least;
}

// Damping hides a common gauge, and a look without damping costs a factorization. So the scalar j of the smallest pivot
// is asked first, for one solution v of (H + λD) v = e_j: where H v is nothing, v_j = vᵀ(H + λD)v is λ vᵀDv alone. Not
// where a linear prior is: what was marginalized holds a window, and its updates are not to pay for this.
bool Minimizer::may_have_gauge() {
  const LinearStructure& s = e_.structure_;
  if (summary_.linearizations == 0 || s.prior_count() > 0) return false;
  const auto [at, share] = smallest_pivot();
  if (at < 0 || share > kNullPivot + kHidden * factored_lambda_) return false;
  if (share <= kNullPivot) return true;
  std::fill(e_.rhs_.begin(), e_.rhs_.end(), 0.0);
  e_.rhs_[static_cast<std::size_t>(at)] = 1.0;
  std::vector<double> v(static_cast<std::size_t>(s.dim()));
  e_.structure_.factorization().solve(e_.rhs_.data(), v.data(), pool_);
  if (!s.landmarks().empty()) {
    const std::vector<double> gradient = e_.system_.gradient;
    std::fill(e_.system_.gradient.begin(), e_.system_.gradient.end(), 0.0);
    e_.schur_.back_substitute(s, e_.system_, e_.damping_.data(), v.data(), pool_);
    e_.system_.gradient = gradient;
  }
  double damped = 0.0;  // λ vᵀDv
  for (std::size_t i = 0; i < v.size(); ++i) damped += e_.damping_[i] * v[i] * v[i];
  return v[static_cast<std::size_t>(at)] < 2.0 * damped;
}

// Scalars of kept variables that nothing determines, in elimination order; then the factorization is one that holds
// them. H is in `h`, damping all zero at the start.
std::vector<int> Minimizer::hold_null_scalars(const double* h) {
  Multifrontal& factorization = e_.structure_.factorization();
  factorization.factor(h, e_.damping_.data(), pool_);
  std::vector<std::pair<int, int>> found;  // place in elimination, place in a step
  for_each_pivot([&](int scalar, int at, double pivot, double diagonal) {
    if (pivot > 0.0 && pivot > kNullPivot * diagonal) return;
    found.emplace_back(scalar, at);
    e_.damping_[static_cast<std::size_t>(at)] = diagonal > 0.0 ? kHold * diagonal : 1.0;
  });
  std::sort(found.begin(), found.end());
  std::vector<int> scalars;
  scalars.reserve(found.size());
  for (const auto& f : found) scalars.push_back(f.second);
  if (!scalars.empty()) factorization.factor(h, e_.damping_.data(), pool_);
  return scalars;
}

void Minimizer::find_undetermined() {
  const LinearStructure& s = e_.structure_;
  Multifrontal& factorization = e_.structure_.factorization();
  e_.damping_.assign(static_cast<std::size_t>(s.dim()), 0.0);
  e_.rhs_.resize(static_cast<std::size_t>(s.kept_dim()));
  const double* h = e_.system_.h.data();
  e_.step_.assign(e_.system_.gradient.size(), 0.0);
  e_.step_.swap(e_.system_.gradient);  // put aside: landmarks answer to others alone
  if (!s.landmarks().empty()) {
    e_.reduced_.reserve(factorization.storage_size());
    e_.schur_.reduce(s, e_.system_, e_.damping_.data(), e_.reduced_.data(), e_.rhs_.data(), pool_);
    h = e_.reduced_.data();
  }
  const std::vector<int> null = hold_null_scalars(h);
  if (!null.empty() || !e_.schur_.undetermined().empty()) name_undetermined(h, null);
  e_.step_.swap(e_.system_.gradient);
}

void Minimizer::name_undetermined(const double* h, const std::vector<int>& null) {
  const LinearStructure& s = e_.structure_;
  Multifrontal& factorization = e_.structure_.factorization();
  Namer namer(*e_.graph_, s, e_.system_.diagonal);
  std::vector<double> n(s.dim()), rhs(s.kept_dim());
  e_.product_.prepare(s);
  for (std::size_t k = 0; k < e_.schur_.undetermined().size() && k < kMostDirections; ++k) {
    std::fill(n.begin(), n.end(), 0.0);
    n[e_.schur_.undetermined()[k]] = 1.0;
    e_.restriction_.to_tangent(n.data());
    summary_.undetermined.push_back(namer.name(n));
  }
  for (std::size_t k = 0; k < null.size() && k < kMostDirections; ++k) {
    std::fill(n.begin(), n.end(), 0.0);
    n[null[k]] = -1.0;
    e_.product_.kept(h, n.data(), rhs.data());
    for (const int i : null) rhs[i] = 0.0;
    factorization.solve(rhs.data(), n.data(), pool_);
    for (const int i : null) n[i] = i == null[k] ? 1.0 : 0.0;
    for (const LandmarkBlock& l : s.landmarks()) std::fill_n(n.begin() + l.offset, l.dim, 0.0);
    const std::vector<double> free(s.dim(), 0.0);
    if (!s.landmarks().empty()) e_.schur_.back_substitute(s, e_.system_, free.data(), n.data(), pool_);
    e_.restriction_.to_tangent(n.data());
    (namer.is_common(n) ? summary_.gauge : summary_.undetermined).push_back(namer.name(n));
  }
}

}  // namespace oriel
