#include "oriel/evaluate/report.h"

#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <utility>

#include "oriel/io/text.h"

namespace oriel {
namespace {

std::string formatted(const char* format, ...) __attribute__((format(printf, 1, 2)));
std::string formatted(const char* format, ...) {
  char buffer[256];
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof buffer, format, arguments);
  va_end(arguments);
  return buffer;
}

std::string row(const char* name, const ErrorStatistics& s, const char* unit) {
  return formatted("%-24s %10.4f %10.4f %10.4f %10.4f  %s\n", name, s.rmse, s.mean, s.median, s.max, unit);
}

class JsonObject {
 public:
  void number(const char* key, double value) {
    begin(key);
    if (std::isfinite(value))
      append_number(text_, value);
    else
      text_ += "null";
  }
  void count(const char* key, std::size_t value) { raw(key, std::to_string(value)); }
  void text(const char* key, std::string_view value) {
    std::string quoted = "\"";
    for (char c : value) {
      if (c == '"' || c == '\\') quoted += '\\';
      quoted += static_cast<unsigned char>(c) < ' ' ? ' ' : c;
    }
    raw(key, quoted + '"');
  }
  void raw(const char* key, const std::string& value) {
    begin(key);
    text_ += value;
  }
  std::string done() const { return text_ + "}"; }

 private:
  void begin(const char* key) { text_ += (text_.size() > 1 ? ", \"" : "\"") + std::string(key) + "\": "; }
  std::string text_ = "{";
};

std::string json_of(const ErrorStatistics& s) {
  JsonObject o;
  o.count("count", s.count);
  // Of no errors at all there is no mean: null, not a perfect 0.
  const double none = s.count > 0 ? 1 : std::nan("");
  o.number("rmse", none * s.rmse);
  o.number("mean", none * s.mean);
  o.number("median", none * s.median);
  o.number("max", none * s.max);
  return o.done();
}

}  // namespace

Result<EvaluationReport> evaluate(TrajectoryFile estimate, TrajectoryFile truth, const EvaluationOptions& options) {
  const Result<std::vector<PosePair>> pairs = associate(estimate, truth, options.max_dt);
  if (!pairs) return pairs.error();
  Result<AbsoluteError> absolute = absolute_error(estimate.poses, truth.poses, *pairs, options.alignment);
  if (!absolute) {
    Error error = absolute.error();
    error.file = estimate.file_name;
    return error;
  }
  EvaluationReport r;
  r.estimate_file = estimate.file_name, r.truth_file = truth.file_name;
  r.options = options;
  r.estimate_poses = estimate.poses.size(), r.truth_poses = truth.poses.size(), r.pairs = pairs->size();
  r.stamped = truth.stamped;
  const std::size_t first = pairs->front().truth, last = pairs->back().truth;
  if (r.stamped) r.duration_s = (truth.poses[last].time - truth.poses[first].time).seconds();
  r.path_m = path_length(std::span(truth.poses).subspan(first, last - first + 1));
  r.absolute = *absolute;
  const double scale = absolute->alignment.scale;
  r.over_distance =
      relative_error_over_distance(estimate.poses, truth.poses, *pairs, options.relative_distance_m, scale);
  if (r.stamped)
    r.over_time = relative_error_over_time(estimate.poses, truth.poses, *pairs, options.relative_time, scale);
  return r;
}

Result<EvaluationReport> evaluate_files(const std::string& estimate, const std::string& truth,
                                        const EvaluationOptions& options) {
  Result<TrajectoryFile> e = read_trajectory(estimate);
  if (!e) return e.error();
  Result<TrajectoryFile> g = read_trajectory(truth);
  if (!g) return g.error();
  return evaluate(std::move(*e), std::move(*g), options);
}

std::string to_text(const EvaluationReport& r) {
  std::string out;
  out += "estimate   " + r.estimate_file + formatted(" (%zu poses)\n", r.estimate_poses);
  out += "truth      " + r.truth_file + formatted(" (%zu poses)\n", r.truth_poses);
  out += formatted("pairs      %zu, %.3f s, path %.2f m\n", r.pairs, r.duration_s, r.path_m);
  out += "alignment  " + std::string(name_of(r.options.alignment)) +
         formatted(", scale %.6f\n", r.absolute.alignment.scale);
  out += formatted("%-24s %10s %10s %10s %10s\n", "", "RMSE", "mean", "median", "max");
  out += row("position (ATE)", r.absolute.position, "m");
  out += row("orientation", r.absolute.orientation, "deg");
  if (r.over_distance.position.count > 0) {
    const std::string over = formatted(" over %g m", r.options.relative_distance_m);
    out += row(("position" + over).c_str(), r.over_distance.position, "m");
    out += row(("orientation" + over).c_str(), r.over_distance.orientation, "deg");
  }
  if (r.over_time.position.count > 0) {
    const std::string over = formatted(" over %g s", r.options.relative_time.seconds());
    out += row(("position" + over).c_str(), r.over_time.position, "m");
    out += row(("orientation" + over).c_str(), r.over_time.orientation, "deg");
  }
  return out;
}

std::string to_json(const EvaluationReport& r) {
  JsonObject o;
  o.text("estimate", r.estimate_file);
  o.text("groundtruth", r.truth_file);
  o.count("estimate_poses", r.estimate_poses);
  o.count("groundtruth_poses", r.truth_poses);
  o.count("pairs", r.pairs);
  o.text("align", name_of(r.options.alignment));
  o.number("max_dt_s", r.options.max_dt.seconds());
  o.number("scale", r.absolute.alignment.scale);
  o.number("duration_s", r.duration_s);
  o.number("path_m", r.path_m);
  o.number("ate_m", r.absolute.position.rmse);
  o.number("ate_deg", r.absolute.orientation.rmse);
  o.raw("position_m", json_of(r.absolute.position));
  o.raw("orientation_deg", json_of(r.absolute.orientation));
  o.number("rpe_distance_m", r.options.relative_distance_m);
  o.raw("rpe_distance_position_m", json_of(r.over_distance.position));
  o.raw("rpe_distance_orientation_deg", json_of(r.over_distance.orientation));
  o.number("rpe_time_s", r.options.relative_time.seconds());
  o.raw("rpe_time_position_m", json_of(r.over_time.position));
  o.raw("rpe_time_orientation_deg", json_of(r.over_time.orientation));
  return o.done();
}

}  // namespace oriel
