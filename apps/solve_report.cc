#include "apps/solve_report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace oriel::apps {
namespace {

using Json = nlohmann::ordered_json;  // keys in the order in which they are written down here

const char* name_of_method(Method method) {
  return method == Method::gauss_newton ? "gn" : method == Method::dogleg ? "dogleg" : "lm";
}

Json trace_json(const Summary& summary) {
  Json trace = Json::array();
  for (const IterationReport& r : summary.trace) trace.push_back({{"seconds", r.seconds}, {"cost", r.cost}});
  return trace;
}

Json covariance_json(const std::vector<CovarianceBlock>& blocks) {
  Json array = Json::array();
  for (const CovarianceBlock& b : blocks) {
    Json o = {{"variables", b.names}, {"tangents", b.tangents}, {"matrix", Json::array()}};
    const std::size_t n = b.matrix.empty() ? 0 : b.tangents.size();
    for (std::size_t i = 0; i < n; ++i) {
      Json row = Json::array();
      for (std::size_t j = 0; j < n; ++j) row.push_back(b.matrix[j * n + i]);
      o["matrix"].push_back(std::move(row));
    }
    if (!b.error.empty()) o["error"] = b.error;
    array.push_back(std::move(o));
  }
  return array;
}

Json object_of(const SolvedFile& f) {
  const Summary& s = f.summary;
  Json o;
  o["file"] = f.path;
  o["format"] = f.format;
  o["poses"] = f.poses;
  o["landmarks"] = f.landmarks;
  o["factors"] = f.factors;
  o["invalid_factors"] = s.invalid_factors;
  o["self_edges_left_out"] = f.self_edges_left_out;
  o["information_repaired"] = f.information_repaired;
  o["start"] = apps::name_of(f.start);
  o["initial_cost"] = s.initial_cost;
  o["final_cost"] = s.final_cost;
  o["trace"] = trace_json(s);
  o["iterations"] = s.iterations;
  o["converged"] = f.converged();
  o["reason"] = f.reason();
  o["left_to_gain"] = s.gain_open ? Json(*s.predicted_gain) : Json();  // null where no linear model knows it
  o["method"] = name_of_method(s.method);
  o["linear_solver"] = s.linear_solver;
  if (f.graduated)
    o["gnc"] = {
        {"rounds", f.graduated->rounds}, {"factors", f.graduated->factors}, {"outliers", f.graduated->outliers}};
  o["threads"] = f.threads;
  o["seconds"] = {
      {"read", f.read_seconds}, {"setup", f.setup_seconds}, {"solve", s.seconds.total}, {"total", f.total_seconds}};
  o["peak_rss_mb"] = f.peak_rss_mb;
  if (!f.covariances.empty()) o["covariance"] = covariance_json(f.covariances);
  o["gauge"] = f.gauge;
  o["undetermined"] = f.undetermined;
  return o;
}

std::string iterations_text(const Summary& s) {
  std::string out = "  iteration      time [ms]              cost    max |gradient|      lambda\n";
  for (const IterationReport& r : s.trace)
    out += fmt::format("  {:>9} {:>14.3f} {:>17.9g} {:>17.3g} {:>11.2g}{}\n", r.iteration, r.seconds * 1e3, r.cost,
                       r.gradient, r.lambda, r.accepted ? "" : "  rejected");
  const StageTimes& t = s.seconds;
  out += fmt::format(
      "  stages [ms]: structure {:.2f}, evaluate {:.2f}, linearize {:.2f}, eliminate {:.2f}, factor {:.2f}, solve "
      "{:.2f}, "
      "retract {:.2f}, adopt {:.2f}\n",
      t.structure * 1e3, t.evaluate * 1e3, t.linearize * 1e3, t.eliminate * 1e3, t.factor * 1e3, t.solve * 1e3,
      t.retract * 1e3, t.adopt * 1e3);
  out += fmt::format("  {} unknowns ({} kept), {} fronts, {:.3g} Mflop to factor, {:.3g} Mflop to eliminate\n",
                     s.kept_dim + s.landmark_dim, s.kept_dim, s.fronts, s.factor_flops * 1e-6, s.schur_flops * 1e-6);
  if (s.linear_iterations > 0) out += fmt::format("  {} products by conjugate gradients\n", s.linear_iterations);
  return out;
}

}  // namespace

std::string SolvedFile::reason() const {
  if (summary.not_finite_factors == 0) return summary.reason_text();
  return fmt::format("{} factors are not finite > 0; of the rest: {}", summary.not_finite_factors,
                     summary.reason_text());
}

std::string solve_json(const std::vector<SolvedFile>& files) {
  Json array = Json::array();
  for (const SolvedFile& f : files) array.push_back(object_of(f));
  // Not finite becomes null of itself; a path that is no UTF-8 must not end the program.
  return array.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string solve_text(const SolvedFile& f, bool verbose) {
  const Summary& s = f.summary;
  std::string out = fmt::format("{}: {}, {} poses, ", f.path, f.format, f.poses);
  if (f.landmarks > 0) out += fmt::format("{} landmarks, ", f.landmarks);
  out += fmt::format("{} factors, start from {}\n", f.factors, apps::name_of(f.start));
  if (f.self_edges_left_out > 0)
    out += fmt::format("  edges from a pose to itself, left out: {}\n", f.self_edges_left_out);
  if (f.information_repaired > 0)
    out += fmt::format("  edges whose information was indefinite, repaired: {}\n", f.information_repaired);
  if (s.invalid_factors > 0) out += fmt::format("  factors that are not valid at the end: {}\n", s.invalid_factors);
  out += fmt::format("  cost {:.9g} -> {:.9g} in {} iterations ({}, {}, threads {})\n", s.initial_cost, s.final_cost,
                     s.iterations, name_of_method(s.method), s.linear_solver, f.threads);
  out += fmt::format("  {}: {}\n", f.converged() ? "converged" : "NOT converged", f.reason());
  if (s.reason == Reason::deadline) out += fmt::format("  {}\n", s.left_text());
  out += fmt::format("  time: read {:.1f}, setup {:.1f}, solve {:.1f}, total {:.1f} ms; memory {:.0f} MB\n",
                     f.read_seconds * 1e3, f.setup_seconds * 1e3, s.seconds.total * 1e3, f.total_seconds * 1e3,
                     f.peak_rss_mb);
  if (f.graduated)
    out += fmt::format("  graduated: {} rounds; {} of {} factors are outliers\n", f.graduated->rounds,
                       f.graduated->outliers, f.graduated->factors);
  if (verbose) out += iterations_text(s);
  out += covariance_text(f.covariances);
  out += fmt::format("  gauge: {}\n", f.gauge);
  for (const std::string& direction : f.undetermined) out += fmt::format("  undetermined: {}\n", direction);
  return out;
}

}  // namespace oriel::apps
