#include "oriel/solve/summary.h"

#include <cstdio>
#include <ostream>

#include "oriel/graph/graph.h"

namespace oriel {

std::string Summary::reason_text() const {
  auto inequality = [this](const char* left, const char* sign, const char* right) {
    char text[128];
    std::snprintf(text, sizeof text, "%s = %.3g %s %s = %.3g", left, reason_value, sign, right, reason_bound);
    return std::string(text);
  };
  switch (reason) {
    case Reason::nothing_to_do:
      return "no free variable, or no factor: nothing to do";
    case Reason::function_tolerance:
      return inequality("cost decrease", "<=", "function_tolerance * cost");
    case Reason::gradient_tolerance:
      return inequality("max |gradient|", "<=", "gradient_tolerance");
    case Reason::step_tolerance:
      return inequality("max |step|", "<=", "step_tolerance");
    case Reason::no_descending_step:
      return (method == Method::dogleg ? inequality("radius", "<", "least radius")
                                       : inequality("lambda", ">", "largest lambda")) +
             ": no step lowers the cost";
    case Reason::max_iterations:
      return inequality("iterations", ">=", "max_iterations");
    case Reason::deadline:
      return inequality("seconds", ">", "deadline");
    case Reason::stopped_by_callback:
      return "callback() = false";
    case Reason::diverged:
      return inequality("cost after the step", ">=", "cost before");
    case Reason::not_finite:
      return "the cost or the linear system is not finite";
    case Reason::refused:
      return refusal;
  }
  return "";
}

std::string Summary::left_text() const {
  if (!predicted_gain) return "left to gain: not known, no step was computed";
  char text[128];
  std::snprintf(text, sizeof text,
                gain_open ? "left to gain: %.3g, by the linear model"
                          : "left to gain: not known; the step before was to gain %.3g and was taken",
                *predicted_gain);
  return text;
}

std::ostream& operator<<(std::ostream& out, const Summary& s) {
  if (s.reason == Reason::refused) return out << "NOT solved: " << s.refusal << '\n';
  char text[512];
  std::snprintf(
      text, sizeof text,
      "%s after %d iterations (%s): cost %.9g -> %.9g, %lld factors (%lld invalid), %d unknowns, %.3f ms\n"
      "  stages [ms]: structure %.3f, linearize %.3f, eliminate %.3f, factor %.3f, solve %.3f, evaluate %.3f, "
      "adopt %.3f\n",
      s.converged() ? "converged" : "NOT converged", s.iterations, s.reason_text().c_str(), s.initial_cost,
      s.final_cost, static_cast<long long>(s.factors), static_cast<long long>(s.invalid_factors),
      s.kept_dim + s.landmark_dim, s.seconds.total * 1e3, s.seconds.structure * 1e3, s.seconds.linearize * 1e3,
      s.seconds.eliminate * 1e3, s.seconds.factor * 1e3, s.seconds.solve * 1e3, s.seconds.evaluate * 1e3,
      s.seconds.adopt * 1e3);
  out << text;
  if (!s.converged() && !s.failed()) out << "  " << s.left_text() << '\n';
  for (const FactorId& id : s.not_finite)
    out << "  r or Jacobian is not finite: factor #" << id.key.index << '.' << id.key.generation << '\n';
  if (!s.undetermined.empty()) out << "  " << s.undetermined.size() << " directions that nothing determines\n";
  if (!s.gauge.empty()) out << "  gauge: " << s.gauge.size() << " directions common to all\n";
  return out;
}

std::string describe(const Graph& graph, const UndeterminedDirection& direction) {
  std::string text;
  for (const UndeterminedScalar& s : direction.scalars) {
    const VariableOps* ops = graph.find_ops(s.id.type);
    if (!text.empty()) text += ", ";
    text += graph.describe(s.id) + ": ";
    if (ops != nullptr && s.tangent < static_cast<int>(ops->tangent_names.size()))
      text += ops->tangent_names[static_cast<std::size_t>(s.tangent)];
    else
      text += "tangent " + std::to_string(s.tangent);
  }
  if (direction.variables > direction.scalars.size())
    text += " (" + std::to_string(direction.variables) + " variables move together)";
  return text;
}

}  // namespace oriel
