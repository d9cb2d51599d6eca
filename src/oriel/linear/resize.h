// Vectors of a structure that follows a graph: a little more than before is the rule.
#pragma once
#include <cstddef>
#include <vector>

namespace oriel {

// With room for an eighth more, so that what grows a little does not move at once, and doubled where it grows on; pages
// that nobody writes cost nothing.
template <class T>
void resize_with_room(std::vector<T>& v, std::size_t n) {
  if (v.capacity() < n) v.reserve(n + n / 8 > 2 * v.size() ? n + n / 8 : 2 * v.size());
  v.resize(n);
}

// The same room for what was appended one by one.
template <class T>
void keep_room(std::vector<T>& v) {
  if (v.capacity() < v.size() + v.size() / 8) v.reserve(v.size() + v.size() / 8);
}

}  // namespace oriel
