// Values that travel between a caller and a worker: encoded into bytes that share nothing with what they were made of.
//
// Transferable are: plain values (trivially copyable, without pointers), std::string, std::vector and std::array of
// transferable values, std::span<const P> of plain P, and structs of up to 12 such members. Nothing has to be declared
// for a struct that is an aggregate without base classes and C arrays; a class says what travels by a member
// `template <class Visit> void transfer(Visit&& visit) { visit(a, b, c); }`.
//
// A decoded span looks into the message: it is good as long as the message is, in a worker for the length of a job, in
// Task::write until it returns. A message is 32 bytes of header (magic, version, layout of the type, size), then the
// members in order, each aligned; one that is cut short, of another version or of another type is answered with an
// error, and never asks for memory that its own length does not justify.
#pragma once
#include <array>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "oriel/base/bytes.h"
#include "oriel/base/result.h"
#include "oriel/run/transfer_view.h"

namespace oriel {

namespace transfer_detail {

template <class T>
inline constexpr bool kIsSpan = false;
template <class T>
inline constexpr bool kIsSpan<std::span<const T>> = true;
template <class T>
inline constexpr bool kIsVector = false;
template <class T>
inline constexpr bool kIsVector<std::vector<T>> = true;
template <class T>
inline constexpr bool kIsPair = false;
template <class A, class B>
inline constexpr bool kIsPair<std::pair<A, B>> = true;

// Converts to base classes of T alone: only T's base takes it, and a struct with one cannot be taken apart.
template <class T>
struct AnyBase {
  template <class U>
  requires(std::is_base_of_v<U, T> && !std::is_same_v<U, T>) operator U()
      const noexcept;  // NOLINT(google-explicit-constructor)
};
template <class T>
inline constexpr bool kHasBase = requires {
  T{AnyBase<T>{}};
};

inline constexpr std::size_t kMostMembers = 12;

template <class T, std::size_t... I>
constexpr bool takes(std::index_sequence<I...>) {
  return requires { T{(static_cast<void>(I), AnyMember{})...}; };
}
template <class T, std::size_t N = kMostMembers + 1>
constexpr std::size_t member_count() {
  if constexpr (N == 0)
    return 0;
  else if constexpr (takes<T>(std::make_index_sequence<N>{}))
    return N;
  else
    return member_count<T, N - 1>();
}
struct NoVisit {
  template <class... M>
  void operator()(M&...) const {}
};
template <class T>
concept SaysWhatTravels = requires(T& t) {
  t.transfer(NoVisit{});
};

// f(members...) of an aggregate.
template <class T, class F>
constexpr decltype(auto) with_members(T& t, F&& f) {
  constexpr std::size_t n = member_count<std::remove_const_t<T>>();
  static_assert(n <= kMostMembers, "a struct that travels has at most 12 members: put some into a struct of their own");
  if constexpr (n == 0) {
    return f();
  } else if constexpr (n == 1) {
    auto& [a] = t;
    return f(a);
  } else if constexpr (n == 2) {
    auto& [a, b] = t;
    return f(a, b);
  } else if constexpr (n == 3) {
    auto& [a, b, c] = t;
    return f(a, b, c);
  } else if constexpr (n == 4) {
    auto& [a, b, c, d] = t;
    return f(a, b, c, d);
  } else if constexpr (n == 5) {
    auto& [a, b, c, d, e] = t;
    return f(a, b, c, d, e);
  } else if constexpr (n == 6) {
    auto& [a, b, c, d, e, g] = t;
    return f(a, b, c, d, e, g);
  } else if constexpr (n == 7) {
    auto& [a, b, c, d, e, g, h] = t;
    return f(a, b, c, d, e, g, h);
  } else if constexpr (n == 8) {
    auto& [a, b, c, d, e, g, h, i] = t;
    return f(a, b, c, d, e, g, h, i);
  } else if constexpr (n == 9) {
    auto& [a, b, c, d, e, g, h, i, j] = t;
    return f(a, b, c, d, e, g, h, i, j);
  } else if constexpr (n == 10) {
    auto& [a, b, c, d, e, g, h, i, j, k] = t;
    return f(a, b, c, d, e, g, h, i, j, k);
  } else if constexpr (n == 11) {
    auto& [a, b, c, d, e, g, h, i, j, k, l] = t;
    return f(a, b, c, d, e, g, h, i, j, k, l);
  } else {
    auto& [a, b, c, d, e, g, h, i, j, k, l, m] = t;
    return f(a, b, c, d, e, g, h, i, j, k, l, m);
  }
}

// f(members...) of whatever has members.
template <class T, class F>
void visit_members(T& t, F&& f) {
  using V = std::remove_const_t<T>;
  if constexpr (kIsPair<V>)
    f(t.first, t.second);
  else if constexpr (SaysWhatTravels<V>)
    const_cast<V&>(t).transfer(f);  // one function for both ways; writing changes nothing
  else
    with_members(t, f);
}

}  // namespace transfer_detail

// Travels as its bytes.
template <class T>
concept Plain = std::is_trivially_copyable_v<T> && !transfer_detail::SaysWhatTravels<T> &&
                !transfer_detail::looks_elsewhere<T>() && alignof(T) <= 16;

namespace transfer_detail {

template <class T>
constexpr bool is_transferable();
struct AskMembers {
  template <class... M>
  constexpr auto operator()(M&...) const {
    return std::bool_constant<(is_transferable<std::remove_cv_t<M>>() && ...)>{};
  }
};
template <class T>
constexpr bool is_transferable() {
  if constexpr (Plain<T> || std::is_same_v<T, std::string>)
    return true;
  else if constexpr (kIsSpan<T>)
    return Plain<std::remove_const_t<typename T::element_type>>;
  else if constexpr (kIsVector<T> || kIsArray<T>)
    return !std::is_same_v<T, std::vector<bool>> && is_transferable<typename T::value_type>();
  else if constexpr (kIsPair<T>)
    return is_transferable<typename T::first_type>() && is_transferable<typename T::second_type>();
  else if constexpr (SaysWhatTravels<T>)
    return std::is_default_constructible_v<T>;
  else if constexpr (std::is_aggregate_v<T> && std::is_class_v<T> && !kHasBase<T>)
    return decltype(with_members(std::declval<T&>(), AskMembers{}))::value;
  else
    return false;
}

// What a reader must have in common with the writer: members, their order, sizes and alignment.
constexpr std::uint64_t mix(std::uint64_t h, std::uint64_t w) {
  h = (h ^ w) * 0x9e3779b97f4a7c15ull;
  return h ^ (h >> 29);
}
template <class T>
constexpr std::uint64_t layout();
template <class... M>
constexpr std::uint64_t layout_of_all() {
  std::uint64_t h = mix(7, sizeof...(M));
  ((h = mix(h, layout<M>())), ...);
  return h;
}
struct ListMembers {
  template <class... M>
  constexpr auto operator()(M&...) const {
    return std::integral_constant<std::uint64_t, layout_of_all<std::remove_cv_t<M>...>()>{};
  }
};
template <class T>
constexpr std::uint64_t layout() {
  if constexpr (Plain<T>)
    return mix(mix(1, sizeof(T)), alignof(T));
  else if constexpr (std::is_same_v<T, std::string>)
    return 2;
  else if constexpr (kIsSpan<T>)
    return mix(3, layout<std::remove_const_t<typename T::element_type>>());  // reads what a vector wrote
  else if constexpr (kIsVector<T>)
    return mix(3, layout<typename T::value_type>());
  else if constexpr (kIsArray<T>)
    return mix(mix(4, std::tuple_size_v<T>), layout<typename T::value_type>());
  else if constexpr (kIsPair<T>)
    return mix(mix(5, layout<typename T::first_type>()), layout<typename T::second_type>());
  else if constexpr (SaysWhatTravels<T>)
    return mix(6, sizeof(T));  // its members are seen one by one
  else
    return decltype(with_members(std::declval<T&>(), ListMembers{}))::value;
}

}  // namespace transfer_detail

template <class T>
concept Transferable = transfer_detail::is_transferable<T>();

struct TransferHeader {
  static constexpr std::uint32_t kMagic = 0x3154524f;  // "ORT1"
  static constexpr std::uint32_t kVersion = 1;
  std::uint32_t magic = kMagic, version = kVersion;
  std::uint64_t layout = 0, size = 0, reserved = 0;  // size: of what follows [bytes]
};
static_assert(sizeof(TransferHeader) == 32);

class TransferWriter {
 public:
  explicit TransferWriter(Bytes& out) : out_(out) {}

  template <class T>
  void put(const T& x) {
    using namespace transfer_detail;
    if constexpr (Plain<T>) {
      put_plain(&x, sizeof(T), alignof(T));
    } else if constexpr (std::is_same_v<T, std::string>) {
      put(static_cast<std::uint64_t>(x.size()));
      put_plain(x.data(), x.size(), 1);
    } else if constexpr (kIsVector<T> || kIsSpan<T>) {
      using E = std::remove_const_t<typename T::value_type>;
      put(static_cast<std::uint64_t>(x.size()));
      if constexpr (Plain<E>)
        put_plain(x.data(), x.size() * sizeof(E), alignof(E));
      else
        for (const E& e : x) put(e);
    } else if constexpr (kIsArray<T>) {
      for (const auto& e : x) put(e);
    } else {
      visit_members(x, [this](const auto&... m) { (put(m), ...); });
    }
  }

 private:
  void put_plain(const void* data, std::size_t size, std::size_t alignment);
  Bytes& out_;
};

class TransferReader {
 public:
  explicit TransferReader(std::span<const std::byte> in) : in_(in), at_(sizeof(TransferHeader)) {}

  bool at_end() const { return ok_ && at_ == in_.size(); }
  bool ok() const { return ok_; }

  template <class T>
  void get(T& x) {
    using namespace transfer_detail;
    if constexpr (Plain<T>) {
      if (const std::byte* p = get_plain(1, sizeof(T), alignof(T))) std::memcpy(static_cast<void*>(&x), p, sizeof(T));
    } else if constexpr (std::is_same_v<T, std::string>) {
      const std::uint64_t n = get_count();
      if (const std::byte* p = get_plain(n, 1, 1)) x.assign(reinterpret_cast<const char*>(p), n);
    } else if constexpr (kIsSpan<T>) {
      using E = std::remove_const_t<typename T::element_type>;
      const std::uint64_t n = get_count();
      const std::byte* p = get_plain(n, sizeof(E), alignof(E));
      x = p == nullptr ? T() : T(reinterpret_cast<const E*>(p), n);
    } else if constexpr (kIsVector<T>) {
      get_vector(x);
    } else if constexpr (kIsArray<T>) {
      for (auto& e : x) get(e);
    } else {
      visit_members(x, [this](auto&... m) { (get(m), ...); });
    }
  }

 private:
  template <class E>
  void get_vector(std::vector<E>& x) {
    const std::uint64_t n = get_count();
    x.clear();
    if constexpr (Plain<E>) {
      const std::byte* p = get_plain(n, sizeof(E), alignof(E));
      if (p == nullptr || n == 0) return;
      if constexpr (std::is_trivial_v<E> && std::is_copy_assignable_v<E>) {  // no zeros are written first
        const E* const first = reinterpret_cast<const E*>(p);
        x.assign(first, first + n);
      } else {
        x.resize(n);
        std::memcpy(static_cast<void*>(x.data()), p, n * sizeof(E));
      }
    } else {
      if (n > in_.size() - at_) ok_ = false;  // each takes a byte at least
      for (std::uint64_t i = 0; ok_ && i < n; ++i) get(x.emplace_back());
    }
  }
  std::uint64_t get_count() {
    std::uint64_t n = 0;
    get(n);
    return n;
  }
  // Where n items of a size begin; null where they are not all there.
  const std::byte* get_plain(std::uint64_t n, std::size_t size, std::size_t alignment);

  std::span<const std::byte> in_;
  std::size_t at_;
  bool ok_ = true;
};

namespace transfer_detail {
void finish(Bytes& out, std::uint64_t layout);
Result<void> read_transfer_header(std::span<const std::byte> message, std::uint64_t layout);
Error wrong_contents();
}  // namespace transfer_detail

// The message, in place of what `out` held; its memory is used again.
template <Transferable T>
void encode(const T& x, Bytes& out) {
  out.resize(sizeof(TransferHeader));
  TransferWriter(out).put(x);
  transfer_detail::finish(out, transfer_detail::layout<T>());
}

// Into x, whose memory is used again. The message must be aligned to 16 bytes, as vectors and mappings are; after an
// error x is of no use.
template <Transferable T>
Result<void> decode(std::span<const std::byte> message, T& x) {
  if (auto ok = transfer_detail::read_transfer_header(message, transfer_detail::layout<T>()); !ok) return ok;
  TransferReader reader(message);
  reader.get(x);
  if (!reader.at_end()) return transfer_detail::wrong_contents();
  return {};
}

}  // namespace oriel
