// Since when the beginning of a column stands as it does, for those who follow it and would rather not look at all of
// it.
//
//     const std::uint64_t then = mark.count();
//     ... the column changes ...
//     mark.same_since(then);  // whatever stands below this place is as it was
//
// Of constant size: where changes are many, near ones are taken for one, and it answers with less than it could.
#pragma once
#include <cstdint>

namespace oriel {

class ChangeMark {
 public:
  static constexpr std::uint32_t kAll = 0xffffffffu;

  // Grows with each change.
  std::uint64_t count() const { return count_; }
  // What stands at this place or behind it may be another from now on.
  void note(std::uint32_t place) {
    ++count_;
    while (size_ > 0 && steps_[size_ - 1].place >= place) --size_;
    if (size_ == kMost) merge_nearest();
    steps_[size_++] = {count_, place};
  }
  // kAll: nothing has changed.
  std::uint32_t same_since(std::uint64_t count) const {
    for (int i = 0; i < size_; ++i)  // later ones are farther behind
      if (steps_[i].count > count) return steps_[i].place;
    return kAll;
  }

 private:
  static constexpr int kMost = 16;
  struct Step {
    std::uint64_t count = 0;
    std::uint32_t place = 0;
  };

  // The two that lie nearest become one: who looked between them is told of the first once more.
  void merge_nearest() {
    int at = 1;
    for (int i = 2; i < size_; ++i)
      if (steps_[i].place - steps_[i - 1].place < steps_[at].place - steps_[at - 1].place) at = i;
    steps_[at - 1].count = steps_[at].count;
    for (int i = at + 1; i < size_; ++i) steps_[i - 1] = steps_[i];
    --size_;
  }

  Step steps_[kMost];
  int size_ = 0;
  std::uint64_t count_ = 0;
};

}  // namespace oriel
