#include "oriel/io/yaml_fields.h"

#include <algorithm>

#include "oriel/io/text.h"

namespace oriel::io_detail {

Result<YAML::Node> parse_yaml(std::string text, const std::string& file_name) {
  // yaml-cpp knows `%YAML 1.2` and not OpenCV's dialect; as a comment the line keeps the numbers of those below.
  if (text.compare(0, 6, "%YAML:") == 0) text[0] = '#';
  try {
    return YAML::Load(text);
  } catch (const YAML::Exception& e) {
    return Error{ErrorCode::bad_input, "expected YAML: " + e.msg, file_name, e.mark.line + 1};
  }
}

Result<YAML::Node> parse_only_document(std::string text, const std::string& file_name) {
  try {
    const std::vector<YAML::Node> all = YAML::LoadAll(text);
    if (all.size() < 2) return all.empty() ? YAML::Node() : all[0];
    std::int64_t line = all[1].Mark().line + 1;
    if (all[1].IsNull()) {  // it has no place but that of its mark
      const std::size_t mark = std::min(text.size(), text.rfind("\n---"));
      line = 2 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(mark), '\n');
    }
    return Error{ErrorCode::bad_input, "expected one YAML document, found a second", file_name, line};
  } catch (const YAML::Exception& e) {
    return Error{ErrorCode::bad_input, "expected YAML: " + e.msg, file_name, e.mark.line + 1};
  }
}

YamlFields::YamlFields(const YAML::Node& map, std::string file_name, std::string context)
    : map_(map), file_name_(std::move(file_name)), context_(std::move(context)) {
  if (!map_.IsMap()) fail_at(map_, "expected a map of keys and values");
}

void YamlFields::fail_at(const YAML::Node& node, const std::string& message) {
  if (!ok_) return;
  ok_ = false;
  const std::int64_t line = node.IsDefined() && node.Mark().line >= 0 ? node.Mark().line + 1 : 0;
  error_ = {ErrorCode::bad_input, context_ + ": " + message, file_name_, line};
}

YAML::Node YamlFields::get(const char* key) {
  if (!ok_) return {};
  const YAML::Node& map = map_;  // the non-const operator[] would add the key
  YAML::Node node = map[key];
  if (!node.IsDefined() || node.IsNull()) fail_at(map_, std::string("expected the key `") + key + "`, found none");
  return ok_ ? node : YAML::Node();
}

bool YamlFields::has(const char* key) const {
  const YAML::Node& map = map_;
  return map.IsMap() && map[key].IsDefined();
}

YAML::Node YamlFields::child(const char* key) { return get(key); }

void YamlFields::text(const char* key, std::string& out) {
  const YAML::Node node = get(key);
  if (!ok_) return;
  if (!node.IsScalar()) return fail_at(node, std::string("expected text for `") + key + "`");
  out = node.Scalar();
}

void YamlFields::number(const char* key, double& out) {
  const YAML::Node node = get(key);
  if (!ok_) return;
  const std::string found = node.IsScalar() ? node.Scalar() : "a list or a map";
  const NumberFault fault = parse_number(found, out);
  if (fault != NumberFault::none)
    fail_at(node, describe_number(fault, "a finite number", std::string("`") + key + "`", found));
}

void YamlFields::positive(const char* key, double& out) {
  number(key, out);
  if (ok_ && !(out > 0)) fail(key, std::string("expected a positive number for `") + key + "`");
}

void YamlFields::numbers(const char* key, int count, std::vector<double>& out) {
  const YAML::Node node = get(key);
  if (!ok_) return;
  out.clear();
  const std::string expected = std::string("expected a list of ") + (count < 0 ? "" : std::to_string(count) + " ") +
                               "finite numbers for `" + key + "`";
  if (!node.IsSequence() || (count >= 0 && node.size() != static_cast<std::size_t>(count)))
    return fail_at(node, expected + (node.IsSequence() ? ", found " + std::to_string(node.size()) : ""));
  for (const YAML::Node& item : node) {
    double value = 0;
    const std::string found = item.IsScalar() ? item.Scalar() : "a list or a map";
    if (parse_number(found, value) != NumberFault::none)
      return fail_at(item, expected + ", found " + quote_token(found));
    out.push_back(value);
  }
}

void YamlFields::allow_only(std::initializer_list<std::string_view> keys) {
  if (!ok_) return;
  for (const auto& item : map_) {
    const std::string found = item.first.IsScalar() ? item.first.Scalar() : "?";
    if (std::find(keys.begin(), keys.end(), found) != keys.end()) continue;
    std::string known;
    for (std::string_view key : keys) known += (known.empty() ? "" : ", ") + std::string(key);
    return fail_at(item.first, "unknown key " + quote_token(found) + "; expected " + known);
  }
}

void YamlFields::fail(const char* key, const std::string& message) {
  const YAML::Node& map = map_;
  fail_at(map.IsMap() && map[key].IsDefined() ? map[key] : map, message);
}

}  // namespace oriel::io_detail
