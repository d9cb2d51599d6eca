// Reading one map of a YAML file key by key, with errors that name file and line. Private to the readers of this room:
// no public header includes it, so that a user's code needs no yaml-cpp.
#pragma once
#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "oriel/base/result.h"

namespace oriel::io_detail {

// The document in a text; a syntax error is an Error with its line. OpenCV's `%YAML:1.0` first line is passed over.
Result<YAML::Node> parse_yaml(std::string text, const std::string& file_name);
// The same of a text that must have no second document.
Result<YAML::Node> parse_only_document(std::string text, const std::string& file_name);

// Getters return false after the first fault, and error() says what it was; later calls do nothing.
class YamlFields {
 public:
  YamlFields(const YAML::Node& map, std::string file_name, std::string context);

  bool ok() const { return ok_; }
  const Error& error() const { return error_; }

  void text(const char* key, std::string& out);
  void number(const char* key, double& out);
  void positive(const char* key, double& out);
  // A list of `count` finite numbers; where `count` is negative, of any length.
  void numbers(const char* key, int count, std::vector<double>& out);
  YAML::Node child(const char* key);
  bool has(const char* key) const;
  // Any other key is an error that lists these.
  void allow_only(std::initializer_list<std::string_view> keys);
  void fail(const char* key, const std::string& message);

 private:
  YAML::Node get(const char* key);
  void fail_at(const YAML::Node& node, const std::string& message);

  YAML::Node map_;
  std::string file_name_, context_;
  bool ok_ = true;
  Error error_;
};

}  // namespace oriel::io_detail
