// All factors of one (residual, noise shape), or all linear priors: rows in columns that are parallel to a SlotIndex.
#pragma once
#include <vector>

#include "oriel/base/byte_column.h"
#include "oriel/base/slot_map.h"
#include "oriel/graph/type_ops.h"

namespace oriel {

// A variable as a row names it: the pool's place in the graph, and the slot there. It is live as long as the row is.
struct VariableRef {
  std::uint32_t pool = 0;
  std::uint32_t slot = 0;
};

class FactorTable {
 public:
  explicit FactorTable(const FactorOps* ops)
      : ops_(ops), measurements_(ops->measurement_bytes), noises_(ops->noise_bytes) {}

  const FactorOps& ops() const { return *ops_; }
  int arity() const { return static_cast<int>(ops_->variables.size()); }
  const SlotIndex& slots() const { return slots_; }
  SlotIndex& slots() { return slots_; }
  std::uint32_t extent() const { return slots_.extent(); }

  std::span<const VariableRef> variables(std::uint32_t row) const {
    return {&refs_[row * arity()], ops_->variables.size()};
  }
  const void* measurement(std::uint32_t row) const { return measurements_.at(row); }
  const void* noise(std::uint32_t row) const { return noises_.at(row); }
  const Loss& loss(std::uint32_t row) const { return losses_[row]; }
  std::uint64_t added(std::uint32_t row) const { return added_[row]; }
  void set_loss(std::uint32_t row, const Loss& loss) {
    losses_[row] = loss;
    robust_ = robust_ || loss.kind != LossKind::none;
  }
  // True while any row that ever came had a robust loss.
  bool robust() const { return robust_; }
  std::uint32_t& incidence(std::uint32_t row, int arg) { return incidences_[row * arity() + arg]; }

  struct Row {
    SlotKey key;
    std::uint64_t serial;
    const void *measurement, *noise;
    Loss loss;
    const VariableRef* variables;
  };
  std::uint32_t insert(const Row& row, std::uint64_t version);
  void erase(std::uint32_t row) { slots_.erase(slots_.key(row)); }
  void compact_if_due();
  void reserve(std::uint32_t more);

 private:
  const FactorOps* ops_;
  SlotIndex slots_;
  ByteColumn measurements_, noises_;
  std::vector<Loss> losses_;
  std::vector<VariableRef> refs_;
  std::vector<std::uint32_t> incidences_;
  std::vector<std::uint64_t> added_;
  bool robust_ = false;
};

// Linear priors: rows of run-time width. The numbers of a row are one block of doubles in an arena:
// x̂ of its variables (each its bytes, rounded up to doubles), then d (rows), then R (rows × cols, column-major).
class PriorTable {
 public:
  static constexpr std::string_view kName = "linear_prior/1";
  static constexpr std::uint64_t kKey = type_key(kName);

  struct Shape {
    int rows = 0, cols = 0;
    std::uint32_t refs = 0, ref_count = 0;             // in the arena of refs
    std::size_t estimates = 0, d = 0, R = 0, end = 0;  // in the arena of doubles
  };

  const SlotIndex& slots() const { return slots_; }
  SlotIndex& slots() { return slots_; }
  std::uint32_t extent() const { return slots_.extent(); }
  const Shape& shape(std::uint32_t row) const { return shapes_[row]; }
  std::span<const VariableRef> variables(std::uint32_t row) const {
    return {refs_.data() + shapes_[row].refs, shapes_[row].ref_count};
  }
  LinearPriorView numbers(std::uint32_t row) const {
    const Shape& s = shapes_[row];
    return {s.rows, s.cols, arena_.data() + s.R, arena_.data() + s.d};
  }
  // x̂ of all variables of the row, one after the other.
  const double* estimates(std::uint32_t row) const { return arena_.data() + shapes_[row].estimates; }
  std::span<const double> block(std::uint32_t row) const {
    return {arena_.data() + shapes_[row].estimates, shapes_[row].end - shapes_[row].estimates};
  }
  std::uint64_t added(std::uint32_t row) const { return added_[row]; }
  std::uint32_t& incidence(std::uint32_t row, int arg) { return incidences_[shapes_[row].refs + arg]; }

  // `block` as described above; its length tells the rows: |block| = |x̂| + rows (1 + cols).
  std::uint32_t insert(SlotKey key, std::uint64_t serial, std::span<const VariableRef> refs, int cols,
                       std::size_t estimate_doubles, std::span<const double> block, std::uint64_t version);
  void erase(std::uint32_t row) { slots_.erase(slots_.key(row)); }
  void compact_if_due();

 private:
  SlotIndex slots_;
  std::vector<Shape> shapes_;
  std::vector<VariableRef> refs_;
  std::vector<std::uint32_t> incidences_;
  std::vector<double> arena_;
  std::vector<std::uint64_t> added_;
};

}  // namespace oriel
