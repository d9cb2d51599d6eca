// Owned<T>: the one owner of a T on the heap, as std::unique_ptr is. It is here because <memory> brings shared
// pointers, atomics and the parallel algorithms with it: a tenth of a second for every program that includes a graph.
#pragma once
#include <utility>

namespace oriel {

template <class T>
class Owned {
 public:
  Owned() = default;
  explicit Owned(T* p) : p_(p) {}
  Owned(Owned&& other) noexcept : p_(std::exchange(other.p_, nullptr)) {}
  Owned& operator=(Owned&& other) noexcept {
    Owned(std::move(other)).swap(*this);
    return *this;
  }
  ~Owned() {
    static_assert(sizeof(T) > 0, "T must be complete where its owner is destroyed");  // NOLINT(*-sizeof-*)
    delete p_;
  }

  T* get() const { return p_; }
  T& operator*() const { return *p_; }
  T* operator->() const { return p_; }
  explicit operator bool() const { return p_ != nullptr; }
  void swap(Owned& other) noexcept { std::swap(p_, other.p_); }

 private:
  T* p_ = nullptr;
};

template <class T, class... A>
Owned<T> make_owned(A&&... arguments) {
  return Owned<T>(new T(std::forward<A>(arguments)...));
}

}  // namespace oriel
