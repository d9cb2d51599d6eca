// Reading one map of settings of a config after the other, all faults collected. Private to run_config*.cc.
#pragma once
#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "oriel/io/run_config_keys.h"
#include "oriel/io/yaml_fields.h"

namespace oriel::io_detail {

// Faults of one file, each with its line.
class ConfigFaults {
 public:
  ConfigFaults(std::vector<Error>& errors, const std::string& file) : errors_(errors), file_(file) {}
  void add(const YAML::Node& at, const std::string& message) { add(line_of(at), message); }
  void add(std::int64_t line, const std::string& message) {
    errors_.push_back({ErrorCode::bad_input, message, file_, line});
  }
  static std::int64_t line_of(const YAML::Node& node) {
    return node.IsDefined() && node.Mark().line >= 0 ? node.Mark().line + 1 : 0;
  }

 private:
  std::vector<Error>& errors_;
  const std::string& file_;
};

// The text of a key; "?" where it is a list or a map, or nothing that a line could show.
inline std::string key_text(const YAML::Node& key) {
  if (!key.IsScalar()) return "?";
  const std::string text = key.Scalar();
  const bool shown = std::all_of(text.begin(), text.end(), [](char c) { return c > ' ' && c <= '~'; });
  return shown && !text.empty() && text.size() <= 60 ? text : "?";
}

// Where it stands: what says nothing has no place of its own, but its key has.
inline const YAML::Node& place_of(const YAML::Node& key, const YAML::Node& value) {
  return value.IsNull() ? key : value;
}
// ", found a list or a map"
std::string found(const YAML::Node& node);

// Lines by the path of a key ("visual.gate"), negative where what stands there was a fault.
using SettingLines = std::map<std::string, std::int64_t>;

// Sets what a node says; a fault where that is none. `path`: of messages, "visual.gate". Its line is kept in `lines`.
void read_setting(const setting::Kind& kind, void* options, const YAML::Node& key, const YAML::Node& node,
                  const std::string& path, const NameTable<NamedLoss>& losses, SettingLines& lines,
                  ConfigFaults& faults);

// A setting as it is after reading; line 0: by default.
struct SettingRead {
  std::string path;
  const setting::Kind* kind;
  void* options;
  std::int64_t line;
};
// That what is least is not greater than what is greatest.
void check_orders(const std::vector<SettingRead>& settings, ConfigFaults& faults);
// That the task can be run where it is said to be.
void check_place(const RunConfig& config, const SettingLines& lines, ConfigFaults& faults);

// A comment and a line.
void print_setting(std::string& out, const std::string& indent, const std::string& name, const setting::Kind& kind,
                   void* options, const std::string& unit, const std::string& sentence, const RunNames& names);

// The parts of a window: `providers`, `builders` and `hooks` at the top, `policy` in the section `window`.
class PartsReader {
 public:
  PartsReader(WindowPlan& plan, const RunNames& names, const std::string& file, ConfigFaults& faults)
      : plan_(plan), names_(names), file_(file), faults_(faults) {}
  // False: the key is none of these.
  bool read_list(const YAML::Node& at, const YAML::Node& node, const std::string& key);
  void read_policy(const YAML::Node& at, const YAML::Node& node);
  // That each name that a part refers to is there.
  void check_references();

 private:
  struct Referred {
    setting::Reference::To to;
    std::string name, path;
    std::int64_t line;
  };
  bool read_part(const YAML::Node& at, const YAML::Node& node, const std::string& path,
                 const NameTable<WindowPart>& table, PartChoice& out);
  void read_settings(const YAML::Node& map, const std::string& path, const NameTable<WindowPart>& table,
                     PartChoice& out);
  std::string name_of(const YAML::Node& at, const YAML::Node& node, const std::string& path,
                      const NameTable<WindowPart>& table);

  WindowPlan& plan_;
  const RunNames& names_;
  const std::string& file_;
  ConfigFaults& faults_;
  std::vector<Referred> referred_;
};

// As YAML: the parts that there are, and others that could be, as comments.
std::string parts_text(const WindowPlan& plan, const RunNames& names);
std::string policy_text(const WindowPlan& plan, const RunNames& names);

}  // namespace oriel::io_detail
