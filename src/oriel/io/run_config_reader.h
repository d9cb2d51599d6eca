// Reading one map of settings of a config after the other, all faults collected. Private to run_config*.cc.
#pragma once
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

// The text of a key; "?" where it is a list or a map.
inline std::string key_text(const YAML::Node& key) { return key.IsScalar() ? key.Scalar() : "?"; }

// Sets what a node says; a fault where that is none. `path`: of messages, "visual.gate".
void read_setting(const setting::Kind& kind, void* options, const YAML::Node& node, const std::string& path,
                  const NameTable<NamedLoss>& losses, ConfigFaults& faults);

}  // namespace oriel::io_detail
