// What nothing determines: null directions of the undamped linear system, by name.
//
// A pivot that is rounding error marks a scalar j that the rest does not determine. With those scalars left out, the
// rest answers x to the move e_j; n = e_j + x then has H n = 0 up to rounding, and its largest parts are what to tell.
#include <algorithm>
#include <cmath>

#include "oriel/solve/minimizer.h"

namespace oriel {
namespace {

constexpr int kMostDirections = 12;
constexpr std::size_t kMostScalars = 4;  // named for one direction

// y += column of H · x, both in elimination order. The column is that of the front's row j; of its rows those from the
// diagonal down are read, and `scalar` says where each row of the front stands.
void multiply_column(std::span<const Run> runs, const double* column, int j, const std::vector<int>& scalar,
                     const std::vector<double>& x, std::vector<double>& y) {
  for (const Run& run : runs)
    for (int i = 0; i < run.length; ++i) {
      const int row = run.other + i;
      const double v = column[run.row + i];
      if (row >= j) y[scalar[row]] += v * x[scalar[j]];
      if (row > j) y[scalar[j]] += v * x[scalar[row]];
    }
}

// y = H x for H in the layout of the factorization's input; both in elimination order.
void multiply(const Symbolic& symbolic, const double* h, const std::vector<double>& x, std::vector<double>& y) {
  std::fill(y.begin(), y.end(), 0.0);
  std::vector<int> scalar;
  for (const Front& f : symbolic.fronts()) {
    scalar.assign(f.n, 0);
    for (int i = 0; i < f.p; ++i) scalar[i] = f.first_scalar + i;
    for (const Run& r : symbolic.spans(f))
      for (int i = 0; i < r.length; ++i) scalar[r.row + i] = r.other + i;
    for (int k = f.first_position, j = 0; k < f.first_position + f.pivot_blocks; ++k) {
      const int block = symbolic.order()[k];
      const Symbolic::MatrixColumn& column = symbolic.matrix_column(block);
      for (int c = 0; c < symbolic.dim(block); ++c, ++j)
        multiply_column(symbolic.runs(column), h + column.offset + std::int64_t{c} * column.ld, j, scalar, x, y);
    }
  }
}

UndeterminedDirection name_direction(const Graph& graph, const LinearStructure& structure,
                                     const std::vector<double>& n) {
  UndeterminedDirection direction;
  double most = 0.0;
  for (const double v : n) most = std::max(most, std::fabs(v));
  std::vector<int> order(n.size());
  for (std::size_t i = 0; i < n.size(); ++i) order[i] = static_cast<int>(i);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return std::fabs(n[a]) > std::fabs(n[b]); });
  for (std::size_t i = 0; i < order.size() && direction.scalars.size() < kMostScalars; ++i) {
    if (std::fabs(n[order[i]]) < 0.1 * most) break;
    std::uint32_t pool = 0, dense = 0;
    int within = 0;
    structure.locate(order[i], pool, dense, within);
    const VariablePool& p = *graph.pools()[pool];
    direction.scalars.push_back({{p.ops().key, p.slots().key(dense)}, within});
  }
  for (const KeptBlock& b : structure.kept()) {
    double part = 0.0;
    for (int k = 0; k < b.dim; ++k) part = std::max(part, std::fabs(n[b.offset + k]));
    direction.variables += part > 1e-6 * most;
  }
  return direction;
}

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

void Minimizer::find_undetermined() {
  const LinearStructure& s = e_.structure_;
  Multifrontal& factorization = e_.structure_.factorization();
  e_.damping_.assign(static_cast<std::size_t>(s.dim()), 0.0);
  e_.rhs_.resize(static_cast<std::size_t>(s.kept_dim()));
  const double* h = e_.system_.h.data();
  if (!s.landmarks().empty()) {
    e_.reduced_.reserve(factorization.storage_size());
    e_.schur_.reduce(s, e_.system_, e_.damping_.data(), e_.reduced_.data(), e_.rhs_.data(), nullptr);
    h = e_.reduced_.data();
    for (const int i : e_.schur_.undetermined()) {
      std::vector<double> n(s.dim(), 0.0);
      n[i] = 1.0;
      if (summary_.undetermined.size() < kMostDirections)
        summary_.undetermined.push_back(name_direction(*e_.graph_, s, n));
    }
  }
  const FactorReport report = factorization.factor(h, e_.damping_.data(), nullptr);
  std::vector<double> unit(s.kept_dim()), product(s.kept_dim()), n(s.dim());
  const int count =
      std::min({report.undetermined_count, static_cast<int>(report.undetermined.size()), kMostDirections});
  for (int k = 0; k < count; ++k) {
    const auto at = report.undetermined[k];
    std::fill(unit.begin(), unit.end(), 0.0);
    unit[factorization.symbolic().scalar(at.block) + at.row] = -1.0;
    multiply(factorization.symbolic(), h, unit, product);
    factorization.solve_lower(product.data());
    factorization.solve_upper(product.data());
    std::fill(n.begin(), n.end(), 0.0);
    factorization.from_elimination_order(product.data(), n.data());
    n[s.kept()[at.block].offset + at.row] += 1.0;
    UndeterminedDirection direction = name_direction(*e_.graph_, s, n);
    const bool common = direction.variables >= 2 && 2 * direction.variables > s.kept().size();
    (common ? summary_.gauge : summary_.undetermined).push_back(std::move(direction));
  }
}

}  // namespace oriel
