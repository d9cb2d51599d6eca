// Tells one object from another that stands where the first one stood: what two objects own is never equal, as long as
// a copy of either is kept. (std::shared_ptr<const char> without <memory>, which every user's program would compile.)
#pragma once
#include <atomic>
#include <utility>

namespace oriel {

class Identity {
 public:
  Identity() = default;  // nobody's: equal to none, not even to another of its kind
  static Identity make() {
    Identity made;
    made.count_ = new std::atomic<int>{1};
    return made;
  }
  Identity(const Identity& other) : count_(other.count_) {
    if (count_ != nullptr) count_->fetch_add(1, std::memory_order_relaxed);
  }
  Identity(Identity&& other) noexcept : count_(std::exchange(other.count_, nullptr)) {}
  Identity& operator=(Identity other) noexcept {
    std::swap(count_, other.count_);
    return *this;
  }
  ~Identity() {
    if (count_ != nullptr && count_->fetch_sub(1, std::memory_order_acq_rel) == 1) delete count_;
  }
  bool is(const Identity& other) const { return count_ != nullptr && count_ == other.count_; }

 private:
  std::atomic<int>* count_ = nullptr;
};

}  // namespace oriel
