// window_vs_ceres: a visual-inertial window that slides, Oriel against Ceres used as systems of the VINS class use it.
// Same stream, same residuals and whitening, same number of iterations, each side from its own results; the costs have
// to agree update by update. The sides take turns in blocks, so that what else the machine does meets both.
//
// Two kinds of updates: a keyframe comes in and the oldest one is marginalized; another frame comes in, is optimised
// with the window, and gives way to the next.
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
#include "benchmarks/support/peak.h"
#include "benchmarks/support/statistics.h"
#include "benchmarks/support/window_figures.h"
#include "oriel/testing/allocation_counter.h"

namespace oriel::benchmark {
namespace {

struct Arguments {
  WindowOptions window;
  SimulatedWindowOptions stream;
  int slides = 2000, block = 50, trials = 200;
  int raced = 0;     // slides in which Ceres takes part; 0: all
  bool all = false;  // both modes, 10 × 150 and 20 × 400
  std::string json, setting;
};

const char* kUsage =
    "window_vs_ceres [--mode stereo|mono] [--keyframes N] [--landmarks N] | --settings all\n"
    "                [--slides N] [--raced N] [--frames-between on|off] [--iterations N]\n"
    "                [--loss none|huber:K|cauchy:K] [--first-estimates on|off] [--lambda L] [--block N] [--seed N]\n"
    "                [--ceres NAME|none] [--stage-clock wall|cpu] [--json FILE]\n";

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
  if (key == "--raced") return a.raced = number, number >= 1;
  if (key == "--stage-clock") return a.window.cpu_stages = value == "cpu", value == "cpu" || value == "wall";
  if (key == "--settings") return a.all = value == "all", a.all || value == "one";
  if (key == "--frames-between") return a.stream.frames_between = value == "on", value == "on" || value == "off";
  if (key == "--iterations") return a.window.iterations = number, number >= 1;
  if (key == "--block") return a.block = number, number >= 1;
  return false;
}

bool parse(int argc, char** argv, Arguments& a) {
  a.window.loss = Huber(2.0);
  a.stream.frames_between = true;
  for (int i = 1; i < argc; i += 2)
    if (i + 1 >= argc || !set(a, argv[i], argv[i + 1])) {
      std::fprintf(stderr, "window_vs_ceres: %s is not an option with such a value\n%s", argv[i], kUsage);
      return false;
    }
  if (a.raced == 0 || a.raced > a.slides) a.raced = a.slides;
  a.stream.pixel_sigma = a.window.pixel_sigma;
  return true;
}

// The updates of one side, by kind.
struct Updates {
  Samples keyframes, others;
};

template <class Side>
void sample(Side& side, SlideReport (Side::*update)(), Samples& samples) {
  const std::int64_t before = allocation_count();
  samples.reports.push_back((side.*update)());
  samples.allocations.push_back(allocation_count() - before);
}

// Each keyframe is followed by a frame that is none.
template <class Side>
void run_block(Side& side, int slides, bool frames_between, Updates& updates) {
  for (Samples* s : {&updates.keyframes, &updates.others}) s->reserve(slides);  // that is not the window's to ask for
  for (int i = 0; i < slides; ++i) {
    sample(side, &Side::slide, updates.keyframes);
    if (frames_between) sample(side, &Side::pass, updates.others);
  }
}

// Until the window has been full once over, so that what grows to its size has grown.
template <class Side>
void fill(Side& side, const Arguments& a) {
  Updates unused;
  run_block(side, a.window.window - 1, false, unused);
  run_block(side, a.window.window, a.stream.frames_between, unused);
}

// The setting of Ceres with the least median CPU time over the first slides, of those that come to the costs of
// Levenberg–Marquardt in as many iterations: a step that leaves more to do is no faster one.
CeresSetting best_setting(const WindowData& data, const Arguments& a) {
  CeresSetting best;
  Updates reference;
  double least = HUGE_VAL;
  for (const CeresSetting& setting : ceres_window_settings()) {
    if (!a.setting.empty() && setting.name != a.setting) continue;
    CeresWindow window(data, a.window, setting);
    fill(window, a);
    Updates updates;
    run_block(window, std::min(a.trials, a.raced), false, updates);
    if (reference.keyframes.reports.empty()) reference = updates;
    const double t = median(updates.keyframes.column(&SlideReport::cpu));
    const bool same = compare(updates.keyframes, reference.keyframes).median_final < 1e-6;
    std::printf("  ceres %-28s %8.3f ms%s\n", setting.name.c_str(), 1e3 * t, same ? "" : " (ends at other costs)");
    if (same && t < least) least = t, best = setting;
  }
  return best;
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

// What Oriel did in updates of one kind, beside what they take.
nlohmann::json oriel_figures(const Arguments& a, const WindowData& data, const Samples& ours, bool keyframe) {
  nlohmann::json out = figures(ours);
  const WindowCounts counts =
      count_window(data, a.window, static_cast<int>(data.stream.keyframes.size()) - 1, keyframe);
  out["work"] = work_figures(window_work(counts, a.window, ours.reports.back().factor_flops, keyframe), out);
  out["p999_over_p50"] = {{"cpu", out["cpu_ms"]["p999"].get<double>() / out["cpu_ms"]["p50"].get<double>()},
                          {"wall", out["update_ms"]["p999"].get<double>() / out["update_ms"]["p50"].get<double>()}};
  return out;
}

nlohmann::json comparison(const Arguments& a, const WindowData& data, const Updates& ours, const Updates& theirs) {
  nlohmann::json out;
  const auto add = [&](const char* kind, const Samples& x, const Samples& y, bool keyframe) {
    if (x.reports.empty()) return;
    out[kind]["oriel"] = oriel_figures(a, data, x, keyframe);
    if (y.reports.empty()) return;
    out[kind]["ceres"] = figures(y);
    out[kind]["times_faster"] = times_faster(x, y);
    out[kind]["cost_difference"] = to_json(compare(x, y));
  };
  add("keyframes", ours.keyframes, theirs.keyframes, true);
  add("others", ours.others, theirs.others, false);
  return out;
}

void print(const nlohmann::json& out) {
  print_columns();
  for (const char* kind : {"keyframes", "others"}) {
    if (!out.contains(kind)) continue;
    const auto& updates = out[kind];
    print_row((std::string("oriel, ") + kind).c_str(), updates["oriel"]);
    if (updates.contains("ceres")) print_row((std::string("ceres, ") + kind).c_str(), updates["ceres"]);
    std::printf("    oriel: p99.9 / p50 %.2f cpu, %.2f wall\n", updates["oriel"]["p999_over_p50"]["cpu"].get<double>(),
                updates["oriel"]["p999_over_p50"]["wall"].get<double>());
    if (updates.contains("ceres")) print_agreement(updates);
    print_stages("oriel", updates["oriel"]);
    if (updates.contains("ceres")) print_stages("ceres", updates["ceres"]);
    print_work(updates["oriel"]["work"]);
  }
}

// Oriel alone, `--ceres none`: to look at its stages while they are worked on.
int race(const Arguments& a, nlohmann::json& out) {
  const WindowData data = simulate(a.stream, a.window.stereo);
  print_head(a);
  const bool alone = a.setting == "none";
  const CeresSetting setting = alone ? CeresSetting{} : best_setting(data, a);
  OrielWindow oriel(data, a.window);
  oriel.rehearse();
  CeresWindow ceres(data, a.window, setting);
  fill(oriel, a);
  if (!alone) fill(ceres, a);
  Updates ours, theirs;
  for (int done = 0; done < a.slides; done += a.block) {
    run_block(oriel, std::min(a.block, a.slides - done), a.stream.frames_between, ours);
    if (!alone && done < a.raced) run_block(ceres, std::min(a.block, a.raced - done), a.stream.frames_between, theirs);
  }
  if (report_errors(oriel.error(), ceres.error())) return 1;
  out = comparison(a, data, ours, theirs);
  const SlideReport& size = ours.keyframes.reports.back();
  out["mode"] = a.window.stereo ? "stereo" : "mono";
  out["keyframes_in_window"] = a.window.window, out["landmarks"] = size.landmarks;
  out["factors"] = size.reprojections, out["slides"] = a.slides, out["iterations"] = a.window.iterations;
  out["first_estimates"] = a.window.first_estimates, out["ceres_setting"] = alone ? "none" : setting.name;
  std::printf("  a window: %d landmarks, %d factors; unknowns besides landmarks %d; ceres: %s\n", size.landmarks,
              size.reprojections, 15 * a.window.window, alone ? "none" : setting.name.c_str());
  print(out);
  bool same = true;
  for (const char* kind : {"keyframes", "others"})
    if (out.contains(kind) && out[kind].contains("cost_difference"))
      same = same && out[kind]["cost_difference"]["slides_apart"].get<int>() == 0;
  if (!same) std::fprintf(stderr, "window_vs_ceres: the sides came to different costs: that is no race\n");
  if (!alone && a.raced == a.slides)
    std::printf("  position error after %.0f s: oriel %.3f m, ceres %.3f m\n",
                1e-9 * static_cast<double>(data.stream.keyframes.back().time.ns), drift(data, oriel.newest_pose()),
                drift(data, ceres.newest_pose()));
  std::fflush(stdout);
  return same ? 0 : 1;
}

int race_all(Arguments a) {
  struct Setting {
    bool stereo;
    int window, landmarks;
  };
  std::vector<Setting> settings = {{a.window.stereo, a.window.window, a.stream.landmarks}};
  if (a.all) settings = {{true, 10, 150}, {false, 10, 150}, {true, 20, 400}, {false, 20, 400}};
  nlohmann::json out;
  out["fma_gflops"] = 1e-9 * fused_multiply_add_peak();
  out["matrix_product_gflops"] = 1e-9 * matrix_product_rate();
  std::printf("one core: FMA %.0f GF/s, matrix product %.0f GF/s\n", out["fma_gflops"].get<double>(),
              out["matrix_product_gflops"].get<double>());
  int failed = 0;
  for (const Setting& s : settings) {
    a.window.stereo = s.stereo, a.window.window = a.stream.window = s.window, a.stream.landmarks = s.landmarks;
    a.stream.keyframes = 2 * s.window + a.slides;
    failed |= race(a, out["settings"].emplace_back());
  }
  if (!a.json.empty()) std::ofstream(a.json) << out.dump(2) << '\n';
  return failed;
}

}  // namespace
}  // namespace oriel::benchmark

int main(int argc, char** argv) {
  oriel::benchmark::require_single_threaded_blas(argv);
  oriel::benchmark::Arguments arguments;
  if (!oriel::benchmark::parse(argc, argv, arguments)) return 2;
  return oriel::benchmark::race_all(arguments);
}
