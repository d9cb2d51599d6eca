// Function<R(A...)>: any callable, by value, as std::function is; <functional> brings the algorithms and the hash maps
// with it, which every program that includes an engine's options would compile.
#pragma once
#include <cstddef>
#include <type_traits>
#include <utility>

namespace oriel {

template <class Signature>
class Function;

template <class R, class... A>
class Function<R(A...)> {
 public:
  Function() = default;
  Function(std::nullptr_t) {}  // NOLINT(google-explicit-constructor): `options.callback = nullptr;`
  template <class F>
  requires(!std::is_same_v<std::remove_cvref_t<F>, Function> && std::is_invocable_r_v<R, std::decay_t<F>&, A...>)
      Function(F&& f) {  // NOLINT: a lambda where one is expected
    if constexpr (requires { f == nullptr; })
      if (f == nullptr) return;  // an empty std::function or function pointer is an empty Function
    object_ = new std::decay_t<F>(std::forward<F>(f));
    ops_ = &kOps<std::decay_t<F>>;
  }
  Function(const Function& other)
      : object_(other.object_ != nullptr ? other.ops_->copy(other.object_) : nullptr), ops_(other.ops_) {}
  Function(Function&& other) noexcept : object_(std::exchange(other.object_, nullptr)), ops_(other.ops_) {}
  Function& operator=(Function other) noexcept {
    std::swap(object_, other.object_);
    std::swap(ops_, other.ops_);
    return *this;
  }
  ~Function() {
    if (object_ != nullptr) ops_->destroy(object_);
  }

  explicit operator bool() const { return object_ != nullptr; }
  // Only of one that is not empty. Const as that of std::function: what is called may change all the same.
  R operator()(A... arguments) const { return ops_->call(object_, std::forward<A>(arguments)...); }

 private:
  struct Ops {
    R (*call)(void* object, A&&... arguments);
    void* (*copy)(const void* object);
    void (*destroy)(void* object);
  };
  template <class F>
  static constexpr Ops kOps = {[](void* f, A&&... a) -> R {
                                 if constexpr (std::is_void_v<R>)
                                   (*static_cast<F*>(f))(std::forward<A>(a)...);
                                 else
                                   return (*static_cast<F*>(f))(std::forward<A>(a)...);
                               },
                               [](const void* f) -> void* { return new F(*static_cast<const F*>(f)); },
                               [](void* f) { delete static_cast<F*>(f); }};

  void* object_ = nullptr;
  const Ops* ops_ = nullptr;
};

}  // namespace oriel
