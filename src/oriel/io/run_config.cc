#include "oriel/io/run_config.h"

#include <algorithm>

#include "oriel/io/run_config_reader.h"
#include "oriel/io/text.h"

namespace oriel {
namespace io_detail {

void read_setting(const setting::Kind& kind, void* options, const YAML::Node& node, const std::string& path,
                  const NameTable<NamedLoss>& losses, ConfigFaults& faults) {
  const std::string text = node.IsScalar() ? node.Scalar() : "";
  std::string expected = set_setting(kind, options, text, losses);
  if (expected.empty() && node.IsScalar()) return;
  if (expected.empty()) expected = "a name";
  faults.add(node, "expected " + expected + " for `" + path + "`, found " +
                       (node.IsScalar() ? quote_token(text) : std::string("a list or a map")));
}

void print_setting(std::string& out, const std::string& indent, const std::string& name, const setting::Kind& kind,
                   void* options, const std::string& unit, const std::string& sentence, const RunNames& names) {
  out += indent + "# " + setting_comment(kind, unit, sentence) + "\n";
  out += indent + name + ": " + setting_text(kind, options, names.losses) + "\n";
}

}  // namespace io_detail

namespace {

using namespace io_detail;

std::string list(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& w : words) out += (out.empty() ? "" : ", ") + w;
  return out;
}

class Reader {
 public:
  Reader(RunConfigReading& out, const std::string& file, const RunNames& names)
      : config_(out.config),
        errors_(out.errors),
        faults_(out.errors, file),
        names_(names),
        keys_(run_config_keys(names)),
        parts_(out.config.window, names, file, faults_) {}

  void read(const YAML::Node& top) {
    if (!top.IsMap()) return faults_.add(top, "expected a map of keys and values");
    section(top, "");
    for (const ConfigKey& key : keys_)
      if (key.required && seen_.count(full(key.section, key.name)) == 0)
        faults_.add(top, "expected the key `" + full(key.section, key.name) + "`, found none");
    parts_.check_references();
    config_.window.initialisation = config_.odometry.initialisation;
    if (errors_.empty() && config_.task == "sliding_window") put_together();
  }

 private:
  static std::string full(const std::string& section, const std::string& name) {
    return section.empty() ? name : section + "." + name;
  }
  void section(const YAML::Node& map, const std::string& name) {
    for (const auto& item : map) {
      const std::string key = key_text(item.first), path = full(name, key);
      if (!seen_.insert(path).second)
        faults_.add(item.first, "the key `" + path + "` stands twice");
      else if (name.empty() && is_section(key))
        item.second.IsMap() ? section(item.second, key)
                            : faults_.add(item.second, "expected a map of keys under `" + key + "`");
      else
        value(item.first, item.second, name, key);
    }
  }
  // Of sensors of all kinds: whether its parts have what they need of each other.
  void put_together() {
    SensorSuite all;
    all.has_imu = all.has_odometry = all.has_positions = true;
    all.cameras = 2;
    if (const auto window = AssembledWindow::make(config_.window, names_, all); !window)
      errors_.push_back(window.error());
  }
  void value(const YAML::Node& at, const YAML::Node& node, const std::string& section, const std::string& name) {
    const std::string path = full(section, name);
    if (section == "window" && name == "policy") return parts_.read_policy(node);
    if (section.empty() && parts_.read_list(node, name)) return;
    for (const ConfigKey& key : keys_)
      if (section == key.section && name == key.name)
        return read_setting(key.kind, &config_, node, path, names_.losses, faults_);
    for (auto& [task, options] : config_.own)
      for (const Setting& s : names_.tasks.get(task)->settings)
        if (section == task && name == s.name)
          return read_setting(s.kind, options.data(), node, path, names_.losses, faults_);
    faults_.add(at, "unknown key " + quote_token(path) + "; expected " + known(section));
  }
  bool is_section(const std::string& name) const {
    return !name.empty() &&
           (std::any_of(keys_.begin(), keys_.end(), [&](const ConfigKey& k) { return name == k.section; }) ||
            std::any_of(config_.own.begin(), config_.own.end(), [&](const auto& own) { return own.first == name; }));
  }
  std::string known(const std::string& section) const {
    std::vector<std::string> names;
    for (const ConfigKey& k : keys_) {
      const std::string name = section == k.section ? k.name : section.empty() ? k.section : "";
      if (!name.empty() && (names.empty() || names.back() != name)) names.push_back(name);
    }
    for (const auto& [task, unused] : config_.own) {
      if (section.empty()) names.push_back(task);
      for (const Setting& s : names_.tasks.get(task)->settings)
        if (section == task) names.push_back(s.name);
    }
    if (section == "window") names.emplace_back("policy");
    if (section.empty()) names.insert(names.end(), {"providers", "builders", "hooks"});
    return list(names);
  }

  RunConfig& config_;
  std::vector<Error>& errors_;
  ConfigFaults faults_;
  const RunNames& names_;
  std::vector<ConfigKey> keys_;
  PartsReader parts_;
  std::set<std::string> seen_;
};

}  // namespace

ExecutorOptions worker_options(const RunConfig& config, Zygote* zygote) {
  ExecutorOptions o;
  o.zygote = zygote;
  o.time_limit = config.time_limit;
  o.limits.memory_bytes = config.memory_limit_mb * 1'000'000;
  o.spin = config.spin;
  o.retries = config.retries;
  o.retry_late = config.retry_late;
  return o;
}

RunConfig default_run_config(const RunNames& names) {
  RunConfig config;
  config.window = default_plan(names);
  for (const auto& [name, task] : names.tasks.items())
    if (!task.settings.empty()) config.own.emplace_back(name, task.defaults);
  return config;
}

RunConfigReading parse_run_config(std::string text, const std::string& name, const RunNames& names) {
  RunConfigReading out{default_run_config(names), {}};
  const auto top = parse_yaml(std::move(text), name);
  if (top)
    Reader(out, name, names).read(*top);
  else
    out.errors.push_back(top.error());
  return out;
}

RunConfigReading read_run_config(const std::string& path, const RunNames& names) {
  auto text = read_text_file(path);
  if (text) return parse_run_config(std::move(*text), path, names);
  return {{}, {text.error()}};
}

std::string run_config_text(const RunConfig& config, const RunNames& names) {
  RunConfig c = config;
  std::string out, section;
  for (const ConfigKey& key : run_config_keys(names)) {
    if (section != key.section) out += "\n" + (section = key.section) + ":\n";
    print_setting(out, section.empty() ? "" : "  ", key.name, key.kind, &c, key.unit, key.sentence, names);
  }
  out += policy_text(config.window, names) + parts_text(config.window, names);
  for (auto& [task, options] : c.own) {
    out += "\n" + task + ":\n";
    for (const Setting& s : names.tasks.get(task)->settings)
      print_setting(out, "  ", s.name, s.kind, options.data(), s.unit, s.sentence, names);
  }
  return out;
}

std::string run_config_text(const RunNames& names) { return run_config_text(default_run_config(names), names); }

}  // namespace oriel
