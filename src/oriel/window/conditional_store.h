// What marginalized variables are given those that stayed: rows of a square-root elimination, kept for a while. Only
// storage: what is staged, what is known for good, what is forgotten. All blocks have room for the largest so far.
#pragma once
#include <cstdint>
#include <deque>
#include <vector>

#include "oriel/base/time.h"
#include "oriel/graph/ids.h"
#include "oriel/graph/type_ops.h"

namespace oriel {

// 0 = d + R (x_L ⊟ x̂_L) + S (x_S ⊟ x̂_S): x_L left, x_S stayed then.
struct Conditional {
  struct Variable {
    VariableKey id;
    const VariableOps* ops = nullptr;
    int column = -1;           // -1: known, its value is x̂
    std::size_t estimate = 0;  // place of x̂ in `estimates`
  };
  std::vector<Variable> variables;  // leaving ones first
  int leaving = 0;                  // how many of them
  int rows = 0, cols = 0;           // rows: scalars that leave, the first columns
  std::vector<double> estimates;
  // [R S d], rows × (cols + 1), column-major. R is upper triangular; a row of zeros: nothing determines that scalar.
  std::vector<double> numbers;

  void clear();
  void add(VariableKey id, const VariableOps& ops, const void* estimate, int column);
  const double* column(int c) const { return numbers.data() + static_cast<std::ptrdiff_t>(c) * rows; }
  double* column(int c) { return numbers.data() + static_cast<std::ptrdiff_t>(c) * rows; }
  const void* estimate(const Variable& v) const { return estimates.data() + v.estimate; }
};

class ConditionalStore {
 public:
  struct Place {
    VariableKey id;
    std::int32_t entry = 0, variable = 0;
  };

  // An empty one, with memory. It is given back by add, update or release.
  std::int32_t acquire(int capacity);
  Conditional& at(std::int32_t conditional) { return pool_[static_cast<std::size_t>(conditional)]; }
  void release(std::int32_t conditional);

  // Staged: one that is eliminated after all others, or before them; a new version of an entry's.
  void add_newest(std::int32_t conditional) { add(++newest_order_, conditional); }
  void add_oldest(std::int32_t conditional) { add(--oldest_order_, conditional); }
  void update(std::int32_t entry, std::int32_t conditional);

  // What is staged is for good. Beyond `capacity` entries, or older than `horizon` against the newest stamp (0: no
  // limit), the oldest by stamp are forgotten.
  void commit(Time stamp, int capacity, Duration horizon);
  void discard();
  void clear();

  const Place* find(VariableKey id) const;
  VariableKey find(Time stamp, std::uint64_t type) const;
  const Conditional& latest(std::int32_t entry) const;
  std::int64_t order(std::int32_t entry) const { return entries_[static_cast<std::size_t>(entry)].order; }
  std::size_t size() const { return used_; }
  bool was_forgotten(VariableKey id) const;

 private:
  struct Entry {
    std::int64_t order = 0;
    Time stamp;
    std::int32_t now = -1, next = -1;
    bool used = false, fresh = false;
  };
  void add(std::int64_t order, std::int32_t conditional);
  void erase(std::int32_t entry, bool remember);
  void forget(int capacity, Duration horizon);
  void make_room(const Conditional& c);

  std::vector<Entry> entries_;
  std::vector<std::int32_t> free_entries_, free_conditionals_;
  std::deque<Conditional> pool_;
  std::vector<Place> places_;  // sorted by id
  std::vector<VariableKey> forgotten_;
  std::size_t forgotten_at_ = 0, used_ = 0;
  std::size_t room_variables_ = 0, room_estimates_ = 0, room_numbers_ = 0;
  std::int64_t newest_order_ = 0, oldest_order_ = 0;
};

}  // namespace oriel
