// Figures of the window benchmark: what each side did update by update, as medians and tails, as text and as JSON.
#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <vector>

#include "benchmarks/support/window_race.h"
#include "benchmarks/support/window_work.h"

namespace oriel::benchmark {

// What one side did, update by update, after the window had filled.
struct Samples {
  std::vector<SlideReport> reports;
  std::vector<std::int64_t> allocations;
  std::vector<double> column(double SlideReport::*member) const;
  void reserve(int more) {
    reports.reserve(reports.size() + static_cast<std::size_t>(more));
    allocations.reserve(allocations.size() + static_cast<std::size_t>(more));
  }
};

// How far two sides came to the same results.
struct Agreement {
  double median_final = 0.0, worst_final = 0.0, worst_initial = 0.0;
  int worst_slide = 0, apart = 0, other_iterations = 0;  // apart: updates whose final costs differ by more than 1e-6
};
// Over the updates that both have done.
Agreement compare(const Samples& ours, const Samples& theirs);

// Order statistics of times [ms], stages [µs] and allocations.
nlohmann::json figures(const Samples& samples);
// Times of the second side over those of the first, medians over the updates that both have done.
nlohmann::json times_faster(const Samples& ours, const Samples& theirs);
nlohmann::json to_json(const Agreement& agreement);
// Stages with their work [Mflop, MB], rates, and the time that this work takes at kFloorRate.
nlohmann::json work_figures(const WindowWork& work, const nlohmann::json& figures);

void print_columns();
void print_row(const char* name, const nlohmann::json& figures);
void print_stages(const char* name, const nlohmann::json& figures);
void print_work(const nlohmann::json& work);
void print_agreement(const nlohmann::json& comparison);

}  // namespace oriel::benchmark
