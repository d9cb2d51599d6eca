// Random least-squares problems over variables of many dimensions, and the same problem as dense algebra: the oracle of
// the tests of rooms linear and solve.
#pragma once
#include <Eigen/Dense>
#include <functional>
#include <random>

#include "oriel/linear/landmark_schur.h"
#include "oriel/linear/linearize.h"
#include "oriel/manifold/vector.h"

namespace oriel::testing {

// A user's landmark of dimension N.
template <class S, int N>
struct Mark {
  static constexpr char kText[] = {'t', 'e', 's', 't', '.', 'm', 'a', 'r', 'k', '0' + N, '/', '1', '\0'};
  static constexpr std::string_view kName = kText;
  static constexpr int kDim = N;
  static constexpr bool kLandmark = true;
  template <class T>
  using rebind = Mark<T, N>;
  Vec<S, N> v = Vec<S, N>::zero();
  Mark plus(const Vec<S, N>& d) const { return {v + d}; }
  Vec<S, N> minus(const Mark& x) const { return v - x.v; }
};
template <int N>
using Markd = Mark<double, N>;

// "test.mixD" and the names of its variables.
template <int D, class... V>
struct MixName {
  static constexpr std::size_t kSize = 10 + (V::kName.size() + ... + 0) + sizeof...(V);
  static constexpr auto kText = [] {
    std::array<char, kSize> text{};
    std::size_t n = 0;
    for (const char c : std::string_view("test.mix")) text[n++] = c;
    text[n++] = static_cast<char>('0' + D);
    auto append = [&](std::string_view name) {
      text[n++] = '+';
      for (const char c : name) text[n++] = c;
    };
    (append(V::kName), ...);
    return text;
  }();
  static constexpr std::string_view kName{kText.data(), kSize - 1};
};

// r_i = u_i + curvature u_i² - bias_i with u = A y, y being all coordinates of its variables and A made from a seed.
template <int D, class... V>
struct Mix {
  static constexpr std::string_view kName = MixName<D, V...>::kName;
  using Variables = Types<V...>;
  double seed = 0.0, bias = 0.0, curvature = 0.0;

  double entry(int i, int c) const { return std::sin(seed * (1.0 + i) + 1.3 * c * c * (1.0 + 0.3 * i) + c * seed); }
  template <class... W>
  auto operator()(const W&... x) const {
    using S = std::remove_cvref_t<decltype((x.v[0], ...))>;
    Vec<S, D> u = Vec<S, D>::zero();
    int c = 0;
    auto each = [&](const auto& v) {
      for (int k = 0; k < std::remove_cvref_t<decltype(v)>::kSize; ++k, ++c)
        for (int i = 0; i < D; ++i) u[i] = u[i] + S(entry(i, c)) * v[k];
    };
    (each(x.v), ...);
    Vec<S, D> r;
    for (int i = 0; i < D; ++i) r[i] = u[i] + S(curvature) * u[i] * u[i] - S(bias * (1.0 + i));
    return r;
  }
};

class RandomProblem {
 public:
  explicit RandomProblem(unsigned seed) : random_(seed), edit_(graph.edit()) {}

  Graph graph;

  double normal() { return std::normal_distribution<double>()(random_); }
  int pick(std::size_t n) { return static_cast<int>(random_() % n); }
  template <class T>
  const T& any(const std::vector<T>& v) {
    return v[random_() % v.size()];
  }

  template <class V>
  VariableId<V> variable() {
    V x;
    for (int k = 0; k < V::kDim; ++k) x.v[k] = normal();
    return edit_.add(x);
  }
  template <class V>
  std::vector<VariableId<V>> variables(int n) {
    std::vector<VariableId<V>> ids;
    for (int i = 0; i < n; ++i) ids.push_back(variable<V>());
    return ids;
  }
  void fix(VariableKey id) { edit_.fix(id); }

  template <int D, class... V>
  FactorId factor(const Loss& loss, VariableId<V>... ids) {
    const Mix<D, V...> residual{normal() * 10.0, normal(), curvature};
    const double sigma = 0.5 + std::fabs(normal());
    rows_.push_back([=](const Graph& g) {
      Vec<double, D> r;
      Mat<double, D, (V::kDim + ...)> j;
      evaluate_residual(residual, r, &j, g.value(ids)...);
      Rows rows = whitened(r.m, j.m, D, (V::kDim + ...), sigma, loss);
      rows.ids = {VariableKey(ids)...};
      rows.dims = {V::kDim...};
      return rows;
    });
    return edit_.add(residual, Sigma(sigma), loss, ids...);
  }
  template <int D, class... V>
  FactorId factor(VariableId<V>... ids) {
    return factor<D>(Loss::none(), ids...);
  }
  // A linear prior about the origin.
  FactorId prior(const std::vector<VariableKey>& ids, const std::vector<int>& dims, int rows) {
    LinearPrior p;
    p.variables = ids;
    for (const int d : dims) p.cols += d;
    p.rows = rows;
    p.estimates.assign(static_cast<std::size_t>(p.cols), 0.0);
    for (int i = 0; i < rows; ++i) p.d.push_back(normal());
    for (int i = 0; i < rows * p.cols; ++i) p.R.push_back(normal());
    rows_.push_back([=](const Graph& g) {
      Rows out;
      Eigen::VectorXd x(p.cols);
      int c = 0;
      for (std::size_t k = 0; k < ids.size(); ++k) {
        const auto* v = static_cast<const double*>(g.find_value(ids[k]));
        for (int i = 0; i < dims[k]; ++i) x[c++] = v[i];
      }
      out.j = Eigen::Map<const Eigen::MatrixXd>(p.R.data(), rows, p.cols);
      out.r = Eigen::Map<const Eigen::VectorXd>(p.d.data(), rows) + out.j * x;
      out.cost = 0.5 * out.r.squaredNorm();
      out.ids = ids, out.dims = dims;
      return out;
    });
    return edit_.add(p);
  }
  Result<void> apply() {
    auto result = graph.apply(edit_);
    edit_.clear();
    return result;
  }

  struct Dense {
    Eigen::MatrixXd h;
    Eigen::VectorXd g;
    double cost = 0.0;
  };
  // The system in the numbering of a structure.
  Dense dense(const LinearStructure& structure) const {
    Dense d{Eigen::MatrixXd::Zero(structure.dim(), structure.dim()), Eigen::VectorXd::Zero(structure.dim()), 0.0};
    for (const auto& f : rows_) {
      const Rows rows = f(graph);
      d.cost += rows.cost;
      for (std::size_t k = 0, c = 0; k < rows.ids.size(); c += static_cast<std::size_t>(rows.dims[k++])) {
        const int at = offset(structure, rows.ids[k]);
        if (at < 0) continue;
        const auto jk = rows.j.middleCols(static_cast<int>(c), rows.dims[k]);
        d.g.segment(at, rows.dims[k]) += jk.transpose() * rows.r;
        for (std::size_t m = 0, e = 0; m < rows.ids.size(); e += static_cast<std::size_t>(rows.dims[m++]))
          if (const int to = offset(structure, rows.ids[m]); to >= 0)
            d.h.block(at, to, rows.dims[k], rows.dims[m]) +=
                jk.transpose() * rows.j.middleCols(static_cast<int>(e), rows.dims[m]);
      }
    }
    return d;
  }
  int offset(const LinearStructure& structure, VariableKey id) const {
    for (std::size_t p = 0; p < graph.pools().size(); ++p)
      if (graph.pools()[p]->ops().key == id.type)
        return structure.target(p, graph.pools()[p]->slots().find(id.key)).offset;
    return -1;
  }

  double curvature = 0.1;

 private:
  struct Rows {
    Eigen::VectorXd r;
    Eigen::MatrixXd j;
    double cost = 0.0;
    std::vector<VariableKey> ids;
    std::vector<int> dims;
  };
  // Not inlined: GCC 12 would warn of what Eigen reads past a single entry, and compile this for each kind of factor.
  [[gnu::noinline]] static Rows whitened(const double* r, const double* j, int dim, int cols, double sigma,
                                         const Loss& loss) {
    Rows rows;
    rows.r = Eigen::Map<const Eigen::VectorXd>(r, dim) / sigma;
    rows.j = Eigen::Map<const Eigen::MatrixXd>(j, dim, cols) / sigma;
    const auto l = evaluate_loss(loss.kind, loss.scale, rows.r.squaredNorm());
    rows.cost = 0.5 * l.rho;
    rows.r *= std::sqrt(l.weight), rows.j *= std::sqrt(l.weight);
    return rows;
  }

  std::mt19937 random_;
  GraphEdit edit_;
  std::vector<std::function<Rows(const Graph&)>> rows_;
};

// The library's system at the graph's values, Jacobians there as well.
struct System {
  LinearStructure structure;
  Linearizer linearizer;
  Point point;
  ActiveSet active;
  LinearSystem numbers;
  LandmarkSchur schur;

  explicit System(const Graph& graph, TaskPool* pool = nullptr) {
    if (!structure.build(graph, {})) return;
    point.take(graph);
    linearizer.first_estimates = false;
    linearizer.evaluate(graph, structure, point, nullptr, active, pool);
    linearizer.linearize(graph, structure, point, &active, numbers, pool);
    schur.prepare(structure);
  }
  Eigen::VectorXd gradient() const {
    return Eigen::Map<const Eigen::VectorXd>(numbers.gradient.data(), structure.dim());
  }
  // (H + diag(damping)) step = -gradient, landmarks by Schur complement.
  Eigen::VectorXd solve(const Eigen::VectorXd& damping, TaskPool* pool = nullptr) {
    AlignedBuffer s;
    s.reserve(structure.factorization().storage_size());
    Eigen::VectorXd rhs(structure.kept_dim()), step(structure.dim());
    schur.reduce(structure, numbers, damping.data(), s.data(), rhs.data(), pool);
    structure.factorization().factor(s.data(), damping.data(), pool);
    structure.factorization().solve(rhs.data(), step.data());
    schur.back_substitute(structure, numbers, damping.data(), step.data(), pool);
    return step;
  }
};

inline Eigen::VectorXd dense_step(const RandomProblem::Dense& d, const Eigen::VectorXd& damping) {
  return Eigen::MatrixXd(d.h + Eigen::MatrixXd(damping.asDiagonal())).llt().solve(-d.g);
}

}  // namespace oriel::testing
