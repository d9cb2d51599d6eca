// What settings that are right each by itself say together.
#include <optional>

#include "oriel/io/run_config_reader.h"
#include "oriel/io/text.h"

namespace oriel::io_detail {
namespace {

std::optional<double> value_of(const SettingRead& s) {
  if (const auto* r = std::get_if<setting::Real>(s.kind)) return r->at(s.options);
  if (const auto* w = std::get_if<setting::Whole>(s.kind)) return w->at(s.options);
  if (const auto* t = std::get_if<setting::Seconds>(s.kind)) return static_cast<double>(t->at(s.options).ns) / 1e9;
  return std::nullopt;
}

std::string said(const SettingRead& s) {
  std::string out = "`" + s.path + "` = ";
  append_number(out, *value_of(s));
  return out;
}

void check_order(const SettingRead& low, const SettingRead& high, ConfigFaults& faults) {
  const bool wrong = low.line < 0 || high.line < 0;  // said already
  const std::int64_t line = high.line > 0 ? high.line : low.line;
  const auto a = value_of(low), b = value_of(high);
  if (wrong || line == 0 || !a || !b || *a <= *b) return;
  faults.add(line, "expected " + said(low) + " to be at most " + said(high));
}

// A start looks at blocks of a standstill, and at frames that are not given up yet.
constexpr std::pair<std::string_view, std::string_view> kOrders[] = {
    {"initialisation.block", "initialisation.still"},
    {"initialisation.still", "initialisation.longest"},
    {"initialisation.moving", "initialisation.longest"}};

// least_x is at most greatest_x, of whatever it may be.
std::string greatest_of(const std::string& path) {
  constexpr std::string_view kLeast = "least_";
  const std::size_t name = path.rfind('.') + 1;  // 0 where there is no dot
  if (path.compare(name, kLeast.size(), kLeast) != 0) return {};
  return path.substr(0, name) + "greatest_" + path.substr(name + kLeast.size());
}

}  // namespace

void check_orders(const std::vector<SettingRead>& settings, ConfigFaults& faults) {
  for (const SettingRead& low : settings)
    for (const SettingRead& high : settings) {
      bool ordered = greatest_of(low.path) == high.path;
      for (const auto& [a, b] : kOrders) ordered = ordered || (low.path == a && high.path == b);
      if (ordered) check_order(low, high, faults);
    }
}

void check_place(const RunConfig& c, const SettingLines& lines, ConfigFaults& faults) {
  const auto line = [&](const char* key) { return lines.count(key) > 0 ? std::abs(lines.at(key)) : 1; };
  if (c.task == "two_frame") {
    if (c.defer) faults.add(line("defer"), "expected a task with a window where solves are deferred, found two_frame");
    if (c.engine != "native")
      faults.add(line("engine"), "expected the engine native for the task two_frame, found " + quote_token(c.engine));
  } else if (c.task == "inertial_odometry" || c.task == "sliding_window") {  // a task of one's own knows what it needs
    if (c.engine != "native" && (c.defer || c.executor != ExecutorKind::in_place))
      faults.add(line("engine"),
                 "expected the engine native where the executor is not inline or solves are deferred, found " +
                     quote_token(c.engine));
  }
}

}  // namespace oriel::io_detail
