#include "oriel/run/setting.h"

namespace oriel::setting {

std::vector<std::pair<std::string, int>> Word::numbered(std::string_view words) {
  std::vector<std::pair<std::string, int>> out;
  while (!words.empty()) {
    const std::size_t end = words.find(' ');
    out.emplace_back(words.substr(0, end), static_cast<int>(out.size()));
    words.remove_prefix(end == std::string_view::npos ? words.size() : end + 1);
  }
  return out;
}

std::string Word::list() const {
  std::string out;
  for (const auto& [word, unused] : words_) out += (out.empty() ? "" : ", ") + word;
  return out;
}

bool Word::set(void* options, std::string_view to) const {
  for (const auto& [word, value] : words_)
    if (word == to) return set_(options, value), true;
  return false;
}

std::string Word::get(void* options) const {
  const int now = get_(options);
  for (const auto& [word, value] : words_)
    if (value == now) return word;
  return "?";
}

}  // namespace oriel::setting
