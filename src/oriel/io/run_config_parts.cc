// The parts of a window in a config: lists of maps, each with the name of a part and that part's own settings.
#include <algorithm>

#include "oriel/io/run_config_reader.h"
#include "oriel/io/text.h"

namespace oriel::io_detail {
namespace {

bool has(const std::vector<PartChoice>& parts, const std::string& name) {
  return std::any_of(parts.begin(), parts.end(), [&](const PartChoice& p) { return p.name == name; });
}

const Setting* setting_of(const WindowPart& part, const std::string& name) {
  for (const Setting& s : part.settings)
    if (s.name == name) return &s;
  return nullptr;
}

// Another part's setting, by mistake: whose.
std::string owners(const NameTable<WindowPart>& table, const std::string& setting) {
  std::string all;
  for (const auto& [name, part] : table.items())
    if (setting_of(part, setting) != nullptr) all += (all.empty() ? "" : ", ") + name;
  return all.empty() ? all : " (it is of " + all + ")";
}

std::string known(const WindowPart& part) {
  std::string all = "name";
  for (const Setting& s : part.settings) all += ", " + s.name;
  return all;
}

// With `mark` before each line.
void print_part(std::string& out, const std::string& mark, const std::string& first, const std::string& indent,
                const WindowPart& part, const PartChoice& choice, const RunNames& names) {
  AnyOptions options = choice.options;
  out += mark + indent + "# " + part.sentence + "\n" + mark + first + "name: " + choice.name + "\n";
  for (const Setting& s : part.settings) {
    std::string lines;
    print_setting(lines, indent, s.name, s.kind, options.data(), s.unit, s.sentence, names);
    for (std::size_t at = 0; at < lines.size();) {
      const std::size_t end = lines.find('\n', at) + 1;
      out += mark + lines.substr(at, end - at);
      at = end;
    }
  }
}

void print_list(std::string& out, const char* key, const std::vector<PartChoice>& parts,
                const NameTable<WindowPart>& table, const RunNames& names) {
  out += std::string("\n") + key + ":" + (parts.empty() ? " []\n" : "\n");
  for (const PartChoice& p : parts)
    if (const WindowPart* part = table.get(p.name)) print_part(out, "", "  - ", "    ", *part, p, names);
  for (const auto& [name, part] : table.items())
    if (!has(parts, name)) print_part(out, "#", "  - ", "    ", part, {name, part.defaults}, names);
}

}  // namespace

bool PartsReader::read_list(const YAML::Node& at, const YAML::Node& node, const std::string& key) {
  const bool providers = key == "providers", builders = key == "builders";
  if (!providers && !builders && key != "hooks") return false;
  const NameTable<WindowPart>& table = providers ? names_.providers : builders ? names_.builders : names_.hooks;
  std::vector<PartChoice>& out = providers ? plan_.providers : builders ? plan_.builders : plan_.hooks;
  out.clear();
  if (!node.IsSequence())
    return faults_.add(place_of(at, node), "expected a list of parts under `" + key + "`" + found(node)), true;
  for (const YAML::Node& item : node) {
    PartChoice part;
    if (!read_part(at, item, key, table, part)) continue;
    if (key != "hooks" && has(out, part.name))
      faults_.add(item, "two of kind " + table.what() + " are named '" + part.name + "'");
    out.push_back(std::move(part));
  }
  return true;
}

void PartsReader::read_policy(const YAML::Node& at, const YAML::Node& node) {
  PartChoice part;
  if (read_part(at, node, "window.policy", names_.policies, part)) plan_.policy = std::move(part);
}

std::string PartsReader::name_of(const YAML::Node& at, const YAML::Node& node, const std::string& path,
                                 const NameTable<WindowPart>& table) {
  YAML::Node name = node;
  if (node.IsMap()) {
    name.reset(YAML::Node());
    for (const auto& item : node)
      if (key_text(item.first) == "name") name.reset(item.second);
    if (!name.IsScalar()) return faults_.add(node, "expected the key `name` in a part of `" + path + "`"), "";
  } else if (!node.IsScalar()) {
    return faults_.add(place_of(at, node),
                       "expected a name, or a map with the key `name`, under `" + path + "`" + found(node)),
           "";
  }
  if (table.get(name.Scalar()) != nullptr) return name.Scalar();
  faults_.add(name,
              "unknown " + table.what() + " " + quote_token(name.Scalar()) + "; expected one of " + table.names());
  return "";
}

bool PartsReader::read_part(const YAML::Node& at, const YAML::Node& node, const std::string& path,
                            const NameTable<WindowPart>& table, PartChoice& out) {
  out.name = name_of(at, node, path, table);
  if (out.name.empty()) return false;
  out.options = table.get(out.name)->defaults;
  out.file = file_;
  out.line = ConfigFaults::line_of(node);
  if (node.IsMap()) read_settings(node, path + "." + out.name, table, out);
  return true;
}

void PartsReader::read_settings(const YAML::Node& map, const std::string& path, const NameTable<WindowPart>& table,
                                PartChoice& out) {
  const WindowPart& part = *table.get(out.name);
  std::set<std::string> seen;
  SettingLines lines;
  for (const auto& item : map) {
    const std::string key = key_text(item.first);
    const Setting* s = setting_of(part, key);
    if (!seen.insert(key).second) {
      faults_.add(item.first, "the key `" + path + "." + key + "` stands twice");
    } else if (s != nullptr) {
      read_setting(s->kind, out.options.data(), item.first, item.second, path + "." + key, names_.losses, lines,
                   faults_);
      if (const auto* r = std::get_if<setting::Reference>(&s->kind); r != nullptr && item.second.IsScalar())
        referred_.push_back({r->to, item.second.Scalar(), path + "." + key, ConfigFaults::line_of(item.second)});
    } else if (key != "name") {
      faults_.add(item.first, "unknown key " + quote_token(key) + " of the " + table.what() + " " + out.name +
                                  owners(table, key) + "; expected " + known(part));
    }
  }
  std::vector<SettingRead> all;
  for (const Setting& s : part.settings)
    all.push_back({path + "." + s.name, &s.kind, out.options.data(), lines[path + "." + s.name]});
  check_orders(all, faults_);
}

void PartsReader::check_references() {
  for (const Referred& r : referred_) {
    const bool provider = r.to == setting::Reference::To::provider;
    const std::vector<PartChoice>& parts = provider ? plan_.providers : plan_.builders;
    if (r.name.empty() || has(parts, r.name)) continue;
    std::string list;
    for (const PartChoice& p : parts) list += (list.empty() ? "" : ", ") + p.name;
    faults_.add(r.line, "expected one of this window's " + std::string(provider ? "providers" : "builders") + " (" +
                            list + ") for `" + r.path + "`, found " + quote_token(r.name));
  }
}

std::string parts_text(const WindowPlan& plan, const RunNames& names) {
  std::string out = "\n# Of the task sliding_window: what it is put together from.";
  print_list(out, "providers", plan.providers, names.providers, names);
  print_list(out, "builders", plan.builders, names.builders, names);
  print_list(out, "hooks", plan.hooks, names.hooks, names);
  return out;
}

std::string policy_text(const WindowPlan& plan, const RunNames& names) {
  std::string out = "  # What leaves the window; what else there is stands below as a comment.\n  policy:\n";
  if (const WindowPart* part = names.policies.get(plan.policy.name))
    print_part(out, "", "    ", "    ", *part, plan.policy, names);
  for (const auto& [name, part] : names.policies.items())
    if (name != plan.policy.name) print_part(out, "#", "    ", "    ", part, {name, part.defaults}, names);
  return out;
}

}  // namespace oriel::io_detail
