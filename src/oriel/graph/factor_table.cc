#include "oriel/graph/factor_table.h"

#include <algorithm>

namespace oriel {

std::uint32_t FactorTable::insert(const Row& row, std::uint64_t version) {
  const std::uint32_t r = slots_.insert(row.key, row.serial);
  measurements_.push_back(row.measurement);
  noises_.push_back(row.noise);
  losses_.push_back(row.loss);
  refs_.insert(refs_.end(), row.variables, row.variables + arity());
  incidences_.resize(refs_.size());
  added_.push_back(version);
  robust_ = robust_ || row.loss.kind != LossKind::none;
  return r;
}

void FactorTable::compact_if_due() {
  if (!slots_.wants_compaction()) return;
  const std::size_t k = ops_->variables.size();
  slots_.compact(
      [&](std::uint32_t from, std::uint32_t to) {
        measurements_.move(from, to);
        noises_.move(from, to);
        losses_[to] = losses_[from];
        added_[to] = added_[from];
        std::copy_n(refs_.begin() + from * k, k, refs_.begin() + to * k);
        std::copy_n(incidences_.begin() + from * k, k, incidences_.begin() + to * k);
      },
      [&](std::uint32_t n) {
        measurements_.resize(n);
        noises_.resize(n);
        losses_.resize(n);
        added_.resize(n);
        refs_.resize(n * k);
        incidences_.resize(n * k);
      });
}

void FactorTable::reserve(std::uint32_t more) {
  slots_.reserve(more);
  const std::size_t n = extent() + std::size_t{more};
  measurements_.reserve(n);
  noises_.reserve(n);
  reserve_more(losses_, more);
  reserve_more(added_, more);
  reserve_more(refs_, std::size_t{more} * arity());
  reserve_more(incidences_, std::size_t{more} * arity());
}

std::uint32_t PriorTable::insert(SlotKey key, std::uint64_t serial, std::span<const VariableRef> refs, int cols,
                                 std::size_t estimate_doubles, std::span<const double> block, std::uint64_t version) {
  const std::uint32_t r = slots_.insert(key, serial);
  Shape s;
  s.cols = cols;
  s.rows = static_cast<int>((block.size() - estimate_doubles) / (1 + static_cast<std::size_t>(cols)));
  s.refs = static_cast<std::uint32_t>(refs_.size());
  s.ref_count = static_cast<std::uint32_t>(refs.size());
  s.estimates = arena_.size();
  s.d = s.estimates + estimate_doubles;
  s.R = s.d + s.rows;
  s.end = s.estimates + block.size();
  refs_.insert(refs_.end(), refs.begin(), refs.end());
  incidences_.resize(refs_.size());
  arena_.insert(arena_.end(), block.begin(), block.end());
  shapes_.push_back(s);
  added_.push_back(version);
  return r;
}

void PriorTable::compact_if_due() {
  if (!slots_.wants_compaction()) return;
  std::uint32_t refs_end = 0;
  std::size_t arena_end = 0;
  auto settle = [&](Shape s) {  // arenas close up in the same order as rows
    std::copy_n(refs_.begin() + s.refs, s.ref_count, refs_.begin() + refs_end);
    std::copy_n(incidences_.begin() + s.refs, s.ref_count, incidences_.begin() + refs_end);
    std::copy(arena_.begin() + static_cast<std::ptrdiff_t>(s.estimates),
              arena_.begin() + static_cast<std::ptrdiff_t>(s.end),
              arena_.begin() + static_cast<std::ptrdiff_t>(arena_end));
    const std::size_t shift = s.estimates - arena_end;
    s.refs = refs_end;
    s.estimates -= shift;
    s.d -= shift;
    s.R -= shift;
    s.end -= shift;
    refs_end += s.ref_count;
    arena_end = s.end;
    return s;
  };
  for (std::uint32_t row = 0; row < extent(); ++row)
    if (slots_.is_live(row)) shapes_[row] = settle(shapes_[row]);
  slots_.compact(
      [this](std::uint32_t from, std::uint32_t to) {
        shapes_[to] = shapes_[from];
        added_[to] = added_[from];
      },
      [this](std::uint32_t n) {
        shapes_.resize(n);
        added_.resize(n);
      });
  refs_.resize(refs_end);
  incidences_.resize(refs_end);
  arena_.resize(arena_end);
}

}  // namespace oriel
