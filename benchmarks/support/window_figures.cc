#include "benchmarks/support/window_figures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "benchmarks/support/statistics.h"

namespace oriel::benchmark {
namespace {

struct Stage {
  const char* name;
  double StageTimes::*time;
};
constexpr Stage kStages[] = {{"structure", &StageTimes::structure}, {"evaluate", &StageTimes::evaluate},
                             {"linearize", &StageTimes::linearize}, {"eliminate", &StageTimes::eliminate},
                             {"factor", &StageTimes::factor},       {"solve", &StageTimes::solve},
                             {"retract", &StageTimes::retract},     {"adopt", &StageTimes::adopt}};

double number(const nlohmann::json& j, const char* key, const char* q) { return j[key][q].get<double>(); }

nlohmann::json order_statistics(const std::vector<double>& seconds) {
  nlohmann::json out;
  for (const auto& [name, q] : {std::pair{"p50", 0.5}, {"p99", 0.99}, {"p999", 0.999}, {"max", 1.0}})
    out[name] = 1e3 * quantile(seconds, q);
  return out;
}

}  // namespace

std::vector<double> Samples::column(double SlideReport::*member) const {
  std::vector<double> out;
  for (const SlideReport& r : reports) out.push_back(r.*member);
  return out;
}

Agreement compare(const Samples& ours, const Samples& theirs) {
  Agreement a;
  std::vector<double> differences;
  const auto relative = [](double x, double y) { return std::fabs(x - y) / std::max(std::fabs(y), 1e-300); };
  for (std::size_t i = 0; i < std::min(ours.reports.size(), theirs.reports.size()); ++i) {
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

nlohmann::json figures(const Samples& s) {
  nlohmann::json out;
  out["updates"] = s.reports.size();
  out["update_ms"] = order_statistics(s.column(&SlideReport::wall));
  out["cpu_ms"] = order_statistics(s.column(&SlideReport::cpu));
  out["build_ms"] = order_statistics(s.column(&SlideReport::build));
  out["solve_ms"] = order_statistics(s.column(&SlideReport::solve));
  out["marginalize_ms"] = order_statistics(s.column(&SlideReport::fold));
  for (const Stage& stage : kStages) {
    std::vector<double> column;
    for (const SlideReport& r : s.reports) column.push_back(1e6 * (r.stages.*stage.time));
    out["stages_us"][stage.name] = median(column);
  }
  const std::vector<double> counts(s.allocations.begin(), s.allocations.end());
  out["allocations"] = {
      {"p50", median(counts)},
      {"max", quantile(counts, 1.0)},
      {"updates_that_allocate", std::count_if(counts.begin(), counts.end(), [](double n) { return n > 0; })}};
  return out;
}

nlohmann::json times_faster(const Samples& ours, const Samples& theirs) {
  std::vector<double> wall, cpu;
  for (std::size_t i = 0; i < std::min(ours.reports.size(), theirs.reports.size()); ++i) {
    wall.push_back(theirs.reports[i].wall / ours.reports[i].wall);
    cpu.push_back(theirs.reports[i].cpu / ours.reports[i].cpu);
  }
  return {{"wall", median(wall)}, {"cpu", median(cpu)}};
}

nlohmann::json to_json(const Agreement& a) {
  return {{"median", a.median_final},
          {"worst", a.worst_final},
          {"worst_slide", a.worst_slide},
          {"slides_apart", a.apart},
          {"slides_with_other_iterations", a.other_iterations}};
}

nlohmann::json work_figures(const WindowWork& work, const nlohmann::json& f) {
  nlohmann::json out;
  const auto put = [&](const char* name, const Work& w, double us) {
    out[name] = {{"us", us},
                 {"mflop", 1e-6 * w.flops},
                 {"mb", 1e-6 * w.bytes},
                 {"gflops", us > 0.0 ? 1e-3 * w.flops / us : 0.0},
                 {"floor_us", 1e6 * w.flops / kFloorRate}};
  };
  const auto us = [&f](const char* stage) { return f["stages_us"][stage].get<double>(); };
  put("evaluate", work.evaluate, us("evaluate"));
  put("linearize", work.linearize, us("linearize"));
  put("eliminate", work.eliminate, us("eliminate"));
  put("factor", work.factor, us("factor"));
  put("solve", work.solve, us("solve"));
  put("fold", work.fold, 1e3 * number(f, "marginalize_ms", "p50"));
  Work all{work.flops(), 0.0};
  for (const Work* w : {&work.evaluate, &work.linearize, &work.eliminate, &work.factor, &work.solve, &work.fold})
    all.bytes += w->bytes;
  put("update", all, 1e3 * number(f, "cpu_ms", "p50"));
  out["times_floor"] = out["update"]["us"].get<double>() / out["update"]["floor_us"].get<double>();
  return out;
}

void print_columns() {
  std::printf("  %-18s %8s %8s %8s %8s %8s %8s | %8s %8s %8s | %8s %8s\n", "[ms]", "cpu p50", "p99", "p99.9",
              "wall p50", "p99", "p99.9", "build", "solve", "fold", "allocs", "updates");
}

void print_row(const char* name, const nlohmann::json& f) {
  std::printf("  %-18s", name);
  for (const char* clock : {"cpu_ms", "update_ms"})
    for (const char* q : {"p50", "p99", "p999"}) std::printf(" %8.3f", number(f, clock, q));
  std::printf(" | %8.3f %8.3f %8.3f | %8.0f %8.0f\n", number(f, "build_ms", "p50"), number(f, "solve_ms", "p50"),
              number(f, "marginalize_ms", "p50"), number(f, "allocations", "p50"),
              number(f, "allocations", "updates_that_allocate"));
}

void print_stages(const char* name, const nlohmann::json& f) {
  std::printf("  %-18s median us:", name);
  for (const Stage& stage : kStages) std::printf(" %s %.1f", stage.name, f["stages_us"][stage.name].get<double>());
  std::printf("\n");
}

void print_work(const nlohmann::json& work) {
  std::printf("  %-10s %9s %8s %8s %7s %10s\n", "stage", "us", "Mflop", "MB", "GF/s", "floor us");
  for (const char* name : {"evaluate", "linearize", "eliminate", "factor", "solve", "fold", "update"}) {
    const auto& w = work[name];
    const auto n = [&w](const char* key) { return w[key].get<double>(); };
    std::printf("  %-10s %9.1f %8.3f %8.3f %7.1f %10.1f\n", name, n("us"), n("mflop"), n("mb"), n("gflops"),
                n("floor_us"));
  }
  std::printf("  %.2f times the floor (%.1f Mflop at %.0f GF/s)\n", work["times_floor"].get<double>(),
              work["update"]["mflop"].get<double>(), 1e-9 * kFloorRate);
}

void print_agreement(const nlohmann::json& c) {
  const auto& costs = c["cost_difference"];
  std::printf("    times faster than ceres: %.2f cpu, %.2f wall (medians of pairs)\n", number(c, "times_faster", "cpu"),
              number(c, "times_faster", "wall"));
  std::printf(
      "    final costs differ by %.1e (median), %.1e (update %d); by more than 1e-6 in %d; other iterations in %d\n",
      costs["median"].get<double>(), costs["worst"].get<double>(), costs["worst_slide"].get<int>(),
      costs["slides_apart"].get<int>(), costs["slides_with_other_iterations"].get<int>());
}

}  // namespace oriel::benchmark
