// Names of types that are made of other types, e.g. "prior/1(pose3/1)", composed at compile time.
#pragma once
#include <array>
#include <cstddef>
#include <string_view>

namespace oriel {

template <std::size_t N>
constexpr std::array<char, N> composed_text(std::string_view outer, std::string_view inner) {
  std::array<char, N> text{};
  std::size_t k = 0;
  for (char c : outer) text[k++] = c;
  text[k++] = '(';
  for (char c : inner) text[k++] = c;
  text[k++] = ')';
  return text;
}

// kOuter(Inner::kName), with storage of its own. Outer is a struct with kName too, so that it can be a template
// argument.
template <class Outer, class Inner>
struct ComposedName {
  static constexpr auto kText =
      composed_text<Outer::kName.size() + Inner::kName.size() + 2>(Outer::kName, Inner::kName);
  static constexpr std::string_view kName{kText.data(), kText.size()};
};

}  // namespace oriel
