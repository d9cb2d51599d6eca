// window_vs_ceres: a visual-inertial window that slides, Oriel against Ceres used as systems of the VINS class use it.
// Same stream, same residuals and whitening, same number of iterations, each side from its own results; the costs have
// to agree slide by slide. The sides take turns in blocks, so that what else the machine does meets both.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "benchmarks/support/ceres_window.h"
#include "benchmarks/support/fair_environment.h"
#include "benchmarks/support/oriel_window.h"
#include "benchmarks/support/statistics.h"
#include "oriel/testing/allocation_counter.h"

namespace oriel::benchmark {
namespace {

struct Arguments {
  WindowOptions window;
  SimulatedWindowOptions stream;
  int slides = 2000, block = 50, trials = 200;
  std::string json, setting;
};

const char* kUsage =
    "window_vs_ceres [--mode stereo|mono] [--keyframes N] [--landmarks N] [--slides N] [--iterations N]\n"
    "                [--loss none|huber:K|cauchy:K] [--first-estimates on|off] [--lambda L] [--block N] [--seed N]\n"
    "                [--ceres NAME|none] [--json FILE]\n";

bool parse_loss(const std::string& text, Loss& loss) {
  const auto colon = text.find(':');
  const std::string name = text.substr(0, colon);
  const double scale = colon == std::string::npos ? 1.0 : std::atof(text.c_str() + colon + 1);
  if (name == "none") loss = Loss::none();
  if (name == "huber") loss = Huber(scale);
  if (name == "cauchy") loss = Cauchy(scale);
  return (name == "none" || name == "huber" || name == "cauchy") && scale > 0.0;
}

bool set(Arguments& a, const std::string& key, const std::string& value) {
  const int number = std::atoi(value.c_str());
  if (key == "--mode") return a.window.stereo = value == "stereo", value == "stereo" || value == "mono";
  if (key == "--first-estimates") return a.window.first_estimates = value == "on", value == "on" || value == "off";
  if (key == "--loss") return parse_loss(value, a.window.loss);
  if (key == "--json") return a.json = value, true;
  if (key == "--ceres") return a.setting = value, true;
  if (key == "--lambda") return a.window.initial_lambda = std::atof(value.c_str()), a.window.initial_lambda > 0;
  if (key == "--seed") return a.stream.seed = static_cast<std::uint64_t>(number), true;
  if (key == "--keyframes") return a.window.window = number, number >= 3;
  if (key == "--landmarks") return a.stream.landmarks = number, number >= 20;
  if (key == "--slides") return a.slides = number, number >= 1;
  if (key == "--iterations") return a.window.iterations = number, number >= 1;
  if (key == "--block") return a.block = number, number >= 1;
  return false;
}

bool parse(int argc, char** argv, Arguments& a) {
  a.window.loss = Huber(2.0);
  for (int i = 1; i < argc; i += 2)
    if (i + 1 >= argc || !set(a, argv[i], argv[i + 1])) {
      std::fprintf(stderr, "window_vs_ceres: %s is not an option with such a value\n%s", argv[i], kUsage);
      return false;
    }
  a.stream.window = a.window.window;
  a.stream.keyframes = a.window.window - 1 + a.slides;
  a.stream.pixel_sigma = a.window.pixel_sigma;
  return true;
}

// What one side did, slide by slide, after the window had filled.
struct Samples {
  std::vector<SlideReport> reports;
  std::vector<std::int64_t> allocations;
  std::vector<double> column(double SlideReport::*member) const {
    std::vector<double> out;
    for (const SlideReport& r : reports) out.push_back(r.*member);
    return out;
  }
};

template <class Side>
void run_block(Side& side, int slides, Samples& samples) {
  for (int i = 0; i < slides; ++i) {
    const std::int64_t before = allocation_count();
    samples.reports.push_back(side.slide());
    samples.allocations.push_back(allocation_count() - before);
  }
}

template <class Side>
void fill(Side& side, const WindowOptions& options) {
  Samples unused;
  run_block(side, options.window - 1, unused);
}

struct Agreement {
  double median_final = 0.0, worst_final = 0.0, worst_initial = 0.0;
  int worst_slide = 0, apart = 0, other_iterations = 0;  // apart: slides whose final costs differ by more than 1e-6
};
Agreement compare(const Samples& ours, const Samples& theirs) {
  Agreement a;
  std::vector<double> differences;
  const auto relative = [](double x, double y) { return std::fabs(x - y) / std::max(std::fabs(y), 1e-300); };
  for (std::size_t i = 0; i < ours.reports.size(); ++i) {
    const SlideReport &x = ours.reports[i], &y = theirs.reports[i];
    const double final = relative(x.final_cost, y.final_cost);
    differences.push_back(final);
    a.apart += !(final <= 1e-6);
    if (!(final <= a.worst_final)) a.worst_final = final, a.worst_slide = static_cast<int>(i);
    a.worst_initial = std::max(a.worst_initial, relative(x.initial_cost, y.initial_cost));
    a.other_iterations += x.iterations != y.iterations;
  }
  a.median_final = median(differences);
  return a;
}

// The setting of Ceres with the least median CPU time over the first slides, of those that come to the costs of
// Levenberg–Marquardt in as many iterations: a step that leaves more to do is no faster one.
CeresSetting best_setting(const WindowData& data, const Arguments& a) {
  CeresSetting best;
  Samples reference;
  double least = HUGE_VAL;
  for (const CeresSetting& setting : ceres_window_settings()) {
    if (!a.setting.empty() && setting.name != a.setting) continue;
    CeresWindow window(data, a.window, setting);
    fill(window, a.window);
    Samples samples;
    run_block(window, std::min(a.trials, a.slides), samples);
    if (reference.reports.empty()) reference = samples;
    const double t = median(samples.column(&SlideReport::cpu));
    const bool same = compare(samples, reference).median_final < 1e-6;
    std::printf("  ceres %-28s %8.3f ms%s\n", setting.name.c_str(), 1e3 * t, same ? "" : " (ends at other costs)");
    if (same && t < least) least = t, best = setting;
  }
  return best;
}

nlohmann::json figures(const Samples& s) {
  nlohmann::json out;
  const auto put = [&](const char* name, double SlideReport::*member) {
    const auto column = s.column(member);
    out[name] = {
        {"p50", 1e3 * median(column)}, {"p99", 1e3 * quantile(column, 0.99)}, {"max", 1e3 * quantile(column, 1.0)}};
  };
  put("update_ms", &SlideReport::wall);
  put("cpu_ms", &SlideReport::cpu);
  put("build_ms", &SlideReport::build);
  put("solve_ms", &SlideReport::solve);
  put("marginalize_ms", &SlideReport::fold);
  std::vector<double> counts(s.allocations.begin(), s.allocations.end());
  out["allocations"] = {{"p50", median(counts)}, {"max", quantile(counts, 1.0)}};
  return out;
}

void print_row(const char* name, const nlohmann::json& f) {
  const auto p = [&f](const char* key, const char* q) { return f[key][q].get<double>(); };
  std::printf("  %-8s %9.3f %9.3f %9.3f %9.3f | %9.3f %9.3f %9.3f | %10.0f\n", name, p("update_ms", "p50"),
              p("update_ms", "p99"), p("cpu_ms", "p50"), p("cpu_ms", "p99"), p("build_ms", "p50"), p("solve_ms", "p50"),
              p("marginalize_ms", "p50"), p("allocations", "p50"));
}

// Medians over the slides, stage by stage [µs].
nlohmann::json stage_figures(const Samples& s) {
  const auto us = [&s](double StageTimes::*member) {
    std::vector<double> column;
    for (const SlideReport& r : s.reports) column.push_back(1e6 * (r.stages.*member));
    return median(column);
  };
  return {{"structure", us(&StageTimes::structure)}, {"evaluate", us(&StageTimes::evaluate)},
          {"linearize", us(&StageTimes::linearize)}, {"eliminate", us(&StageTimes::eliminate)},
          {"factor", us(&StageTimes::factor)},       {"solve", us(&StageTimes::solve)},
          {"retract", us(&StageTimes::retract)},     {"adopt", us(&StageTimes::adopt)}};
}

void print_stages(const char* name, const nlohmann::json& stages) {
  std::printf("  %-8s median us of a slide:", name);
  for (const char* key : {"structure", "evaluate", "linearize", "eliminate", "factor", "solve", "retract", "adopt"})
    std::printf(" %s %.1f", key, stages[key].get<double>());
  std::printf("\n");
}

double drift(const WindowData& data, const Pose3d& pose) {
  return (data.stream.keyframes.back().T_world_body.t - pose.t).norm();
}

bool report_errors(const std::string& ours, const std::string& theirs) {
  if (!ours.empty()) std::fprintf(stderr, "window_vs_ceres: oriel: %s\n", ours.c_str());
  if (!theirs.empty()) std::fprintf(stderr, "window_vs_ceres: ceres: %s\n", theirs.c_str());
  return !ours.empty() || !theirs.empty();
}

void print_head(const Arguments& a) {
  std::printf("%s, %d keyframes, %d landmarks, %d slides, %d LM iterations, first estimates %s\n",
              a.window.stereo ? "stereo" : "mono", a.window.window, a.stream.landmarks, a.slides, a.window.iterations,
              a.window.first_estimates ? "on" : "off");
}
const char* kColumns =
    "  [ms]     update p50       p99   cpu p50       p99 |     build     solve      fold | allocations\n";

void print_comparison(const nlohmann::json& out) {
  const auto& costs = out["cost_difference"];
  std::printf("  times faster than ceres (%s): %.2f wall, %.2f cpu (medians of pairs)\n",
              out["ceres_setting"].get<std::string>().c_str(), out["times_faster"]["wall"].get<double>(),
              out["times_faster"]["cpu"].get<double>());
  std::printf(
      "  final costs differ by %.1e (median), %.1e (slide %d); by more than 1e-6 in %d; other iterations in %d\n",
      costs["median"].get<double>(), costs["worst"].get<double>(), costs["worst_slide"].get<int>(),
      costs["slides_apart"].get<int>(), costs["slides_with_other_iterations"].get<int>());
}

nlohmann::json comparison(const Arguments& a, const Samples& ours, const Samples& theirs, const std::string& setting) {
  std::vector<double> wall, cpu;
  for (std::size_t i = 0; i < ours.reports.size(); ++i) {
    wall.push_back(theirs.reports[i].wall / ours.reports[i].wall);
    cpu.push_back(theirs.reports[i].cpu / ours.reports[i].cpu);
  }
  const Agreement agreement = compare(ours, theirs);
  const SlideReport& size = theirs.reports.back();
  return {{"mode", a.window.stereo ? "stereo" : "mono"},
          {"keyframes", a.window.window},
          {"landmarks", size.landmarks},
          {"residual_blocks", size.reprojections},
          {"residual_rows", size.residual_rows},
          {"slides", a.slides},
          {"iterations", a.window.iterations},
          {"first_estimates", a.window.first_estimates},
          {"ceres_setting", setting},
          {"times_faster", {{"wall", median(wall)}, {"cpu", median(cpu)}}},
          {"cost_difference",
           {{"median", agreement.median_final},
            {"worst", agreement.worst_final},
            {"worst_slide", agreement.worst_slide},
            {"slides_apart", agreement.apart},
            {"slides_with_other_iterations", agreement.other_iterations}}}};
}

// Oriel alone: to look at its stages while they are worked on.
int run_alone(const Arguments& a, const WindowData& data) {
  OrielWindow oriel(data, a.window);
  fill(oriel, a.window);
  Samples ours;
  run_block(oriel, a.slides, ours);
  std::fputs(kColumns, stdout);
  print_row("oriel", figures(ours));
  print_stages("oriel", stage_figures(ours));
  return report_errors(oriel.error(), {}) ? 1 : 0;
}

int race(const Arguments& a) {
  const WindowData data = simulate(a.stream, a.window.stereo);
  print_head(a);
  if (a.setting == "none") return run_alone(a, data);
  const CeresSetting setting = best_setting(data, a);
  OrielWindow oriel(data, a.window);
  CeresWindow ceres(data, a.window, setting);
  fill(oriel, a.window), fill(ceres, a.window);
  Samples ours, theirs;
  for (int done = 0; done < a.slides; done += a.block) {
    run_block(oriel, std::min(a.block, a.slides - done), ours);
    run_block(ceres, std::min(a.block, a.slides - done), theirs);
  }
  if (report_errors(oriel.error(), ceres.error())) return 1;
  nlohmann::json out = comparison(a, ours, theirs, setting.name);
  out["oriel"] = figures(ours), out["ceres"] = figures(theirs);
  out["oriel"]["stages_us"] = stage_figures(ours), out["ceres"]["stages_us"] = stage_figures(theirs);
  const SlideReport& size = theirs.reports.back();
  std::printf("  a window: %d landmarks, %d residual blocks, %d rows; unknowns besides landmarks %d\n", size.landmarks,
              size.reprojections, size.residual_rows, 15 * a.window.window);
  std::fputs(kColumns, stdout);
  print_row("oriel", out["oriel"]), print_row("ceres", out["ceres"]);
  print_stages("oriel", out["oriel"]["stages_us"]), print_stages("ceres", out["ceres"]["stages_us"]);
  print_comparison(out);
  std::printf("  position error after %.0f s: oriel %.3f m, ceres %.3f m\n",
              1e-9 * static_cast<double>(data.stream.keyframes.back().time.ns), drift(data, oriel.newest_pose()),
              drift(data, ceres.newest_pose()));
  if (!a.json.empty()) std::ofstream(a.json) << out.dump(2) << '\n';
  return 0;
}

}  // namespace
}  // namespace oriel::benchmark

int main(int argc, char** argv) {
  oriel::benchmark::require_single_threaded_blas(argv);
  oriel::benchmark::Arguments arguments;
  if (!oriel::benchmark::parse(argc, argv, arguments)) return 2;
  return oriel::benchmark::race(arguments);
}
