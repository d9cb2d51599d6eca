#include "oriel/solve/defaults.h"

#include <cmath>

namespace oriel {
namespace {

// A leap that the first linearization promises may land on a plateau, from which no way leads back (NIST's MGH09,
// MGH10, BoxBOD): a regression begins with steps along the gradient.
constexpr double kCarefulLambda = 1e4, kCarefulRadius = 0.2;

double first_lambda(const SolveOptions& options, bool landmarks, bool regression) {
  if (options.method == Method::gauss_newton) return 0.0;
  if (options.initial_lambda > 0.0) return options.initial_lambda;
  return landmarks ? 1e-4 : regression ? kCarefulLambda : 1e-8;
}

double first_radius(const SolveOptions& options, bool landmarks, bool regression) {
  if (options.initial_radius > 0.0) return options.initial_radius;
  return landmarks ? 1e4 : regression ? kCarefulRadius : HUGE_VAL;
}

}  // namespace

bool is_regression(const Graph& graph) {
  const VariableOps* free = nullptr;
  for (const auto& pool : graph.pools()) {
    if (pool->ops().dim == 0) continue;
    for (std::uint32_t d = 0; d < pool->extent(); ++d) {
      if (!pool->slots().is_live(d) || pool->fixed(d)) continue;
      if (free != nullptr) return false;
      free = &pool->ops();
    }
  }
  // VectorN's own names: "vector3/1".
  return free != nullptr && free->name.size() == 9 && free->name.starts_with("vector") && free->name.ends_with("/1");
}

Settled settle(const SolveOptions& options, bool landmarks, bool regression) {
  auto chosen = [&](auto given, auto usual, auto of_regression) {
    return given >= 0 ? given : regression ? of_regression : usual;
  };
  Settled s;
  s.initial_lambda = first_lambda(options, landmarks, regression);
  s.initial_radius = first_radius(options, landmarks, regression);
  s.max_iterations = chosen(options.max_iterations, 100, 10000);
  // Gauss–Newton stops where the cost rises, be it in the last digit.
  const double all_digits = options.method == Method::gauss_newton ? 1e-12 : 1e-16;
  s.function_tolerance = chosen(options.function_tolerance, 1e-9, all_digits);
  s.gradient_tolerance = chosen(options.gradient_tolerance, 1e-10, 0.0);
  s.step_tolerance = chosen(options.step_tolerance, 1e-12, 0.0);
  return s;
}

}  // namespace oriel
