// Which blocks of a symmetric block matrix are not zero: dimensions of the block rows, and an undirected graph over
// them. Knows dimensions and never types. All buffers only grow, so that the pattern of a steady window allocates
// nothing.
#pragma once
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace oriel {

class BlockPattern {
 public:
  // Begins a new pattern: block i has dims[i] >= 1 rows.
  void reset(std::span<const int> dims);
  // Block (i, j) and its transpose are not zero. Any number of times, in any order; i == j says nothing new.
  void connect(int i, int j);
  // Every pair of these blocks is not zero: what one factor over these variables contributes.
  void connect_all(std::span<const int> blocks);
  // Sorts what was connected into neighbour lists, without duplicates, in time linear in the number of pairs.
  void finish();

  // Begins a change of a finished pattern: from block `from` on the dimensions are these. Blocks may be gone from its
  // end, or new there, and those that `is_changed` have from now on the neighbours that are connected until
  // `finish_change`; both ends of what is new or gone are among them. Pairs neither of which is changed need not be
  // connected again.
  void begin_change(int from, std::span<const int> dims);
  void finish_change(std::span<const char> is_changed);

  int blocks() const { return static_cast<int>(dims_.size()); }
  int dim(int i) const { return dims_[i]; }
  int offset(int i) const { return offsets_[i]; }  // first scalar of block i, in the order of the input
  int total_dim() const { return offsets_.empty() ? 0 : offsets_.back(); }
  // Ascending, without i itself. Valid after finish().
  std::span<const int> neighbours(int i) const {
    return {neighbours_.data() + begin_[i], static_cast<std::size_t>(begin_[i + 1] - begin_[i])};
  }
  // The same blocks, tied in the same way; both finished.
  bool same_as(const BlockPattern& other) const {
    return dims_ == other.dims_ && begin_ == other.begin_ && neighbours_ == other.neighbours_;
  }
  // Takes over a finished one, to be compared with; nothing that was connected comes with it.
  void remember(const BlockPattern& other);
  // Length of all neighbour lists: twice the number of different pairs.
  int neighbour_count() const { return static_cast<int>(neighbours_.size()); }

 private:
  void bucket_by_second();
  void bucket_by_first();
  std::vector<int> dims_, offsets_;
  std::vector<std::pair<int, int>> pairs_;
  std::vector<int> begin_, neighbours_;
  std::vector<int> bucket_begin_, bucketed_, last_seen_;  // scratch of finish() and finish_change()
};

}  // namespace oriel
