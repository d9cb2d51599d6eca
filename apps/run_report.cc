// What a run says, for programs and for people.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/run_recording.h"

namespace oriel::apps {

std::string to_json(const RunReport& r) {
  nlohmann::ordered_json dropped = nlohmann::ordered_json::object();
  for (const auto& [reason, n] : r.dropped) dropped[reason] = n;
  const nlohmann::ordered_json json = {
      // a number that is not finite is written as null
      {"recording", r.recording},
      {"duration_s", r.duration_s},
      {"states", r.states},
      {"updates", r.updates},
      {"solves_refused", r.solves_refused},
      {"frames_per_second", r.frames_per_second},
      {"update_ms",
       {{"p50", r.update_ms_p50}, {"p99", r.update_ms_p99}, {"p999", r.update_ms_p999}, {"max", r.update_ms_max}}},
      {"initialised_after_s", r.initialised_after_s},
      {"coverage", r.coverage},
      {"ate_m", r.ate_m},
      {"ate_final_m", r.ate_final_m},
      {"ate_deg", r.ate_deg},
      {"path_m", r.path_m},
      {"dropped", dropped},
      {"allocations_per_update", r.allocations_per_update},
      {"peak_rss_mb", r.peak_rss_mb},
      {"warnings", r.warnings}};
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

std::string to_text(const RunReport& r) {
  std::string text =
      fmt::format("{}: {} of {} frames in {:.1f} s have an estimate, the first after {:.2f} s; path {:.2f} m\n",
                  r.recording, r.states, r.updates, r.duration_s, r.initialised_after_s, r.path_m);
  text += fmt::format("  error (ATE, SE(3)-aligned): {:.4f} m and {:.3f} deg as it went, {:.4f} m in the end\n",
                      r.ate_m, r.ate_deg, r.ate_final_m);
  text += fmt::format("  update: p50 {:.2f} ms, p99 {:.2f} ms, max {:.2f} ms; {:.1f} allocations, {:.0f} MB at most\n",
                      r.update_ms_p50, r.update_ms_p99, r.update_ms_max, r.allocations_per_update, r.peak_rss_mb);
  text += fmt::format("  {:.1f} frames a second, with all that is between them\n", r.frames_per_second);
  text += "  dropped:";
  for (const auto& [reason, n] : r.dropped)
    if (n > 0) text += fmt::format(" {} {}", n, reason);
  text += "\n";
  for (const std::string& warning : r.warnings) text += "  warning: " + warning + "\n";
  return text;
}

}  // namespace oriel::apps
