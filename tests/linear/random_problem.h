// Random least-squares problems over variables of many dimensions, and the same problem as dense algebra: the oracle of
// the tests of rooms linear and solve. What does not depend on a factor's type is compiled once, in
// tests/support/random_problem.cc.
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
  explicit RandomProblem(unsigned seed);
  RandomProblem(RandomProblem&&) noexcept;
  ~RandomProblem();

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
  FactorId prior(const std::vector<VariableKey>& ids, const std::vector<int>& dims, int rows);
  Result<void> apply();

  struct Dense {
    Eigen::MatrixXd h;
    Eigen::VectorXd g;
    double cost = 0.0;
  };
  // The system in the numbering of a structure.
  Dense dense(const LinearStructure& structure) const;
  int offset(const LinearStructure& structure, VariableKey id) const;

  double curvature = 0.1;

 private:
  struct Rows {
    Eigen::VectorXd r;
    Eigen::MatrixXd j;
    double cost = 0.0;
    std::vector<VariableKey> ids;
    std::vector<int> dims;
    Rows();
    Rows(Rows&&) noexcept;
    Rows& operator=(Rows&&) noexcept;
    ~Rows();
  };
  static Rows whitened(const double* r, const double* j, int dim, int cols, double sigma, const Loss& loss);

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

  explicit System(const Graph& graph, TaskPool* pool = nullptr);
  Eigen::VectorXd gradient() const;
  // (H + diag(damping)) step = -gradient, landmarks by Schur complement.
  Eigen::VectorXd solve(const Eigen::VectorXd& damping, TaskPool* pool = nullptr);
};

Eigen::VectorXd dense_step(const RandomProblem::Dense& d, const Eigen::VectorXd& damping);

}  // namespace oriel::testing
