// Which types look elsewhere: pointers and views, and what holds them. Their bytes are of no use to another process
// (transfer.h).
#pragma once
#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>

namespace oriel::transfer_detail {

template <class T>
inline constexpr bool kIsArray = false;
template <class T, std::size_t N>
inline constexpr bool kIsArray<std::array<T, N>> = true;

template <class T>
inline constexpr bool kIsView =
    std::is_pointer_v<T> || std::is_member_pointer_v<T> || std::is_same_v<T, std::string_view>;
template <class T, std::size_t N>
inline constexpr bool kIsView<std::span<T, N>> = true;
template <class T>
inline constexpr bool kIsView<std::reference_wrapper<T>> = true;

// Whether a T is, or holds, a pointer or a view: its bytes are of no use elsewhere. As far as that can be seen from
// outside: of aggregates their members, and theirs; of classes that say nothing of themselves, nothing.
template <class T>
constexpr bool looks_elsewhere();
template <class T>
struct Holds {  // of a T that is no aggregate
  static constexpr bool kView = false;
};
template <class T>
struct Holds<std::optional<T>> {
  static constexpr bool kView = looks_elsewhere<T>();
};
template <class... T>
struct Holds<std::variant<T...>> {
  static constexpr bool kView = (looks_elsewhere<T>() || ...);
};
template <class T, std::size_t N>
struct Holds<std::array<T, N>> {
  static constexpr bool kView = looks_elsewhere<T>();
};

struct AnyMember {
  template <class T>
  operator T() const noexcept;  // NOLINT(google-explicit-constructor): never defined, only asked for
};
// Converts to what must not travel as bytes.
struct LooksElsewhere {
  template <class T>
  requires(looks_elsewhere<T>()) operator T() const noexcept;  // NOLINT(google-explicit-constructor)
};

template <class T, std::size_t... I>
constexpr bool takes_view_after(std::index_sequence<I...>) {
  return requires { T{(static_cast<void>(I), AnyMember{})..., LooksElsewhere{}}; };
}
template <class T, std::size_t... N>
constexpr bool any_view(std::index_sequence<N...>) {
  return (takes_view_after<T>(std::make_index_sequence<N>{}) || ...);
}
inline constexpr std::size_t kFarthestView = 32;  // among the members, and the elements of C arrays
template <class T>
constexpr bool looks_elsewhere() {
  if constexpr (kIsView<T>)
    return true;
  else if constexpr (std::is_aggregate_v<T> && std::is_class_v<T> && !kIsArray<T>)
    return any_view<T>(std::make_index_sequence<kFarthestView>{});
  else
    return Holds<T>::kView;
}

}  // namespace oriel::transfer_detail
