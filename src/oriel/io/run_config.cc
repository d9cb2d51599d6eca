#include "oriel/io/run_config.h"

#include <algorithm>
#include <set>
#include <sstream>

#include "oriel/io/loss_text.h"
#include "oriel/io/run_config_keys.h"
#include "oriel/io/text.h"
#include "oriel/io/yaml_fields.h"

namespace oriel {
namespace {

using namespace io_detail;

std::vector<std::string> words_of(const char* text) {
  std::vector<std::string> out;
  std::istringstream in(text);
  for (std::string word; in >> word;) out.push_back(word);
  return out;
}
std::string number(double x) {
  std::string out;
  append_number(out, x);
  return out;
}
std::string list(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& w : words) out += (out.empty() ? "" : ", ") + w;
  return out;
}
std::string loss_text(const Loss& loss) {
  switch (loss.kind) {
    case LossKind::huber:
      return "huber:" + number(loss.scale);
    case LossKind::cauchy:
      return "cauchy:" + number(loss.scale);
    case LossKind::geman_mcclure:
      return "geman-mcclure:" + number(loss.scale);
    case LossKind::tukey:
      return "tukey:" + number(loss.scale);
    case LossKind::truncated:
      return "truncated:" + number(loss.scale);
    case LossKind::barron:
      return "barron:" + number(loss.scale) + ':' + (loss.shape < -1e300 ? "-inf" : number(loss.shape));
    default:
      return "none";
  }
}

// What is wrong with a text as the value of a setting; empty where nothing is, and then it was set.
struct Set {
  RunConfig& config;
  const std::string& text;

  std::string operator()(const Word& w) const {
    const auto words = words_of(w.words);
    const auto it = std::find(words.begin(), words.end(), text);
    if (it == words.end()) return "one of " + list(words);
    w.set(config, static_cast<int>(it - words.begin()));
    return {};
  }
  std::string operator()(const Real& r) const {
    double x = 0.0;
    if (parse_number(text, x) != NumberFault::none || x < r.least || x > r.greatest)
      return "a number from " + number(r.least) + " to " + number(r.greatest);
    r.at(config) = x;
    return {};
  }
  std::string operator()(const Whole& w) const {
    std::int64_t x = 0;
    if (parse_integer(text, x) != NumberFault::none || x < w.least || x > w.greatest)
      return "a whole number from " + std::to_string(w.least) + " to " + std::to_string(w.greatest);
    w.at(config) = static_cast<int>(x);
    return {};
  }
  std::string operator()(const Count& c) const {
    std::int64_t x = 0;
    if (parse_integer(text, x) != NumberFault::none || x < 0 || x > (std::int64_t{1} << 40))
      return "a whole number that is not negative";
    c.at(config) = static_cast<std::uint64_t>(x);
    return {};
  }
  std::string operator()(const Seconds& s) const {
    double x = 0.0;
    if (parse_number(text, x) != NumberFault::none || x < 0.0 || x > 1e9 || (x == 0.0 && !s.may_be_zero))
      return s.may_be_zero ? "a number of seconds, or 0" : "a positive number of seconds";
    s.at(config) = Duration::from_seconds(x);
    return {};
  }
  std::string operator()(const Flag& f) const {
    if (text != "true" && text != "false") return "true or false";
    f.at(config) = text == "true";
    return {};
  }
  std::string operator()(const Robust& r) const {
    const auto loss = parse_loss(text);
    if (!loss) return "a loss, none or NAME:SCALE";
    r.at(config) = *loss;
    return {};
  }
};

struct Print {
  RunConfig& config;
  std::string operator()(const Word& w) const { return words_of(w.words)[static_cast<std::size_t>(w.get(config))]; }
  std::string operator()(const Real& r) const { return number(r.at(config)); }
  std::string operator()(const Whole& w) const { return std::to_string(w.at(config)); }
  std::string operator()(const Count& c) const { return std::to_string(c.at(config)); }
  std::string operator()(const Seconds& s) const { return number(static_cast<double>(s.at(config).ns) / 1e9); }
  std::string operator()(const Flag& f) const { return f.at(config) ? "true" : "false"; }
  std::string operator()(const Robust& r) const { return loss_text(r.at(config)); }
};

class Reader {
 public:
  Reader(RunConfigReading& out, const std::string& file) : out_(out), file_(file) {}

  void read(const YAML::Node& top) {
    if (!top.IsMap()) return fail(top, "expected a map of keys and values");
    section(top, "");
    for (const ConfigKey& key : run_config_keys())
      if (key.required && seen_.count(full(key.section, key.name)) == 0)
        fail(top, "expected the key `" + full(key.section, key.name) + "`, found none");
  }

 private:
  static std::string full(const std::string& section, const std::string& name) {
    return section.empty() ? name : section + "." + name;
  }
  void section(const YAML::Node& map, const std::string& name) {
    for (const auto& item : map) {
      const std::string key = item.first.IsScalar() ? item.first.Scalar() : "?", path = full(name, key);
      if (!seen_.insert(path).second)
        fail(item.first, "the key `" + path + "` stands twice");
      else if (name.empty() && is_section(key))
        item.second.IsMap() ? section(item.second, key)
                            : fail(item.second, "expected a map of keys under `" + key + "`");
      else
        value(item.first, item.second, name, key);
    }
  }
  void value(const YAML::Node& at, const YAML::Node& node, const std::string& section, const std::string& name) {
    const auto keys = run_config_keys();
    const auto it = std::find_if(keys.begin(), keys.end(),
                                 [&](const ConfigKey& k) { return section == k.section && name == k.name; });
    if (it == keys.end())
      return fail(at, "unknown key " + quote_token(full(section, name)) + "; expected " + known(section));
    const std::string text = node.IsScalar() ? node.Scalar() : "";
    const std::string expected = std::visit(Set{out_.config, text}, it->kind);
    if (!expected.empty())
      fail(node, "expected " + expected + " for `" + full(section, name) + "`, found " +
                     (node.IsScalar() ? quote_token(text) : std::string("a list or a map")));
  }
  static bool is_section(const std::string& name) {
    const auto keys = run_config_keys();
    return !name.empty() &&
           std::any_of(keys.begin(), keys.end(), [&](const ConfigKey& k) { return name == k.section; });
  }
  static std::string known(const std::string& section) {
    std::vector<std::string> names;
    for (const ConfigKey& k : run_config_keys()) {
      const std::string name = section == k.section ? k.name : section.empty() ? k.section : "";
      if (!name.empty() && (names.empty() || names.back() != name)) names.push_back(name);
    }
    return list(names);
  }
  void fail(const YAML::Node& node, const std::string& message) {
    const std::int64_t line = node.IsDefined() && node.Mark().line >= 0 ? node.Mark().line + 1 : 0;
    out_.errors.push_back({ErrorCode::bad_input, message, file_, line});
  }

  RunConfigReading& out_;
  const std::string& file_;
  std::set<std::string> seen_;
};

}  // namespace

RunConfigReading parse_run_config(std::string text, const std::string& name) {
  RunConfigReading out;
  const auto top = parse_yaml(std::move(text), name);
  if (top)
    Reader(out, name).read(*top);
  else
    out.errors.push_back(top.error());
  return out;
}

RunConfigReading read_run_config(const std::string& path) {
  auto text = read_text_file(path);
  if (text) return parse_run_config(std::move(*text), path);
  return {{}, {text.error()}};
}

std::string run_config_text(const RunConfig& config) {
  RunConfig c = config;
  std::string out, section;
  for (const ConfigKey& key : run_config_keys()) {
    if (section != key.section) out += std::string(out.empty() ? "" : "\n") + (section = key.section) + ":\n";
    const std::string indent = section.empty() ? "" : "  ";
    out += indent + "# " + key.sentence;
    if (const auto* word = std::get_if<Word>(&key.kind)) out += " " + list(words_of(word->words)) + ".";
    if (std::string_view(key.unit) != "-") out += std::string(" [") + key.unit + "]";
    out += "\n" + indent + key.name + ": " + std::visit(Print{c}, key.kind) + "\n";
  }
  return out;
}

}  // namespace oriel
