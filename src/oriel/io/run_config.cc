#include "oriel/io/run_config.h"

#include <algorithm>

#include "oriel/io/run_config_reader.h"
#include "oriel/io/text.h"

namespace oriel {
namespace io_detail {

std::string found(const YAML::Node& node) {
  if (node.IsNull()) return ", found nothing";
  return ", found " + (node.IsScalar() ? quote_token(node.Scalar()) : std::string("a list or a map"));
}

void read_setting(const setting::Kind& kind, void* options, const YAML::Node& key, const YAML::Node& node,
                  const std::string& path, const NameTable<NamedLoss>& losses, SettingLines& lines,
                  ConfigFaults& faults) {
  const YAML::Node& at = place_of(key, node);
  const std::int64_t line = lines[path] = ConfigFaults::line_of(at);
  std::string expected = set_setting(kind, options, node.IsScalar() ? node.Scalar() : "", losses);
  if (expected.empty() && node.IsScalar()) return;
  if (expected.empty()) expected = "a name";
  lines[path] = -line;
  faults.add(at, "expected " + expected + " for `" + path + "`" + found(node));
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
    const std::int64_t first = std::max<std::int64_t>(1, ConfigFaults::line_of(top));  // of an empty file as well
    if (!top.IsMap()) return faults_.add(first, "expected a map of keys and values" + found(top));
    section(top, "");
    for (const ConfigKey& key : keys_)
      if (key.required && seen_.count(full(key.section, key.name)) == 0)
        faults_.add(first, "expected the key `" + full(key.section, key.name) + "`, found none");
    parts_.check_references();
    check_orders(settings(), faults_);
    check_place(config_, lines_, faults_);
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
                            : faults_.add(place_of(item.first, item.second),
                                          "expected a map of keys under `" + key + "`" + found(item.second));
      else
        value(item.first, item.second, name, key);
    }
  }
  // Of sensors of all kinds: whether its parts have what they need of each other.
  void put_together() {
    SensorSuite all;
    all.has_imu = all.has_odometry = all.has_positions = true;
    all.cameras = 2;
    const auto window = AssembledWindow::make(config_.window, names_, all);
    if (window) return;
    if (!window.error().file.empty()) return errors_.push_back(window.error());
    // Of a list that is empty, or of a part that is there by default.
    const WindowPlan& plan = config_.window;
    const char* key = plan.providers.empty() ? "providers" : plan.builders.empty() ? "builders" : "task";
    faults_.add(lines_[key], window.error().message);
  }
  // All that there are, with their lines.
  std::vector<SettingRead> settings() {
    std::vector<SettingRead> all;
    const auto add = [&](const std::string& path, const setting::Kind& kind, void* options) {
      const auto line = lines_.find(path);
      all.push_back({path, &kind, options, line == lines_.end() ? 0 : line->second});
    };
    for (const ConfigKey& key : keys_) add(full(key.section, key.name), key.kind, &config_);
    for (auto& [task, options] : config_.own)
      for (const Setting& s : names_.tasks.get(task)->settings) add(full(task, s.name), s.kind, options.data());
    return all;
  }
  void value(const YAML::Node& at, const YAML::Node& node, const std::string& section, const std::string& name) {
    const std::string path = full(section, name);
    if (section == "window" && name == "policy") return parts_.read_policy(at, node);
    if (section.empty() && parts_.read_list(at, node, name)) return void(lines_[name] = ConfigFaults::line_of(at));
    for (const ConfigKey& key : keys_)
      if (section == key.section && name == key.name)
        return read_setting(key.kind, &config_, at, node, path, names_.losses, lines_, faults_);
    for (auto& [task, options] : config_.own)
      for (const Setting& s : names_.tasks.get(task)->settings)
        if (section == task && name == s.name)
          return read_setting(s.kind, options.data(), at, node, path, names_.losses, lines_, faults_);
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
  SettingLines lines_;
};

// Who looks at a section: those of other tasks may stand there, and nobody does.
std::string tasks_of(const std::string& section) {
  if (section == "window") return "Of the task sliding_window.";
  if (section == "two_frame") return "Of the task two_frame.";
  if (section == "initialisation") return "Of the task inertial_odometry, and of the provider imu of sliding_window.";
  return "Of the task inertial_odometry.";
}

}  // namespace

ExecutorOptions worker_options(const RunConfig& config, Zygote* zygote) {
  ExecutorOptions o;
  o.zygote = zygote;
  o.time_limit = config.time_limit;
  o.limits.memory_bytes = config.memory_limit_mb * 1'000'000;
  o.limits.cpu_seconds = config.cpu_limit_s;
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
  const auto top = parse_only_document(std::move(text), name);
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
    if (section != key.section) out += "\n# " + tasks_of(section = key.section) + "\n" + section + ":\n";
    print_setting(out, section.empty() ? "" : "  ", key.name, key.kind, &c, key.unit, key.sentence, names);
  }
  out += policy_text(config.window, names) + parts_text(config.window, names);
  for (auto& [task, options] : c.own) {
    out += "\n# Of the task " + task + ".\n" + task + ":\n";
    for (const Setting& s : names.tasks.get(task)->settings)
      print_setting(out, "  ", s.name, s.kind, options.data(), s.unit, s.sentence, names);
  }
  return out;
}

std::string run_config_text(const RunNames& names) { return run_config_text(default_run_config(names), names); }

}  // namespace oriel
