// Which kept variables see which landmark, and where the blocks of each landmark stand.
#include <algorithm>
#include <bit>

#include "oriel/linear/resize.h"
#include "oriel/linear/structure.h"

namespace oriel {
namespace {

constexpr int kLargestPanel = 640;  // kept scalars up to which landmarks may be columns of one tall matrix

}  // namespace

// For each landmark, the kept blocks that share a factor with it, ascending and once each.
void LinearStructure::find_neighbours() {
  first_seen_ = landmarks_.empty() ? static_cast<int>(kept_.size()) : 0;
  while (first_seen_ < static_cast<int>(kept_.size()) && !kept_[first_seen_].sees_landmarks) ++first_seen_;
  first_scalar_ = first_seen_ < static_cast<int>(kept_.size()) ? kept_[first_seen_].offset : kept_dim_;
  seen_by_.clear();
  if (landmarks_.empty()) return neighbours_.clear();
  const int seen = static_cast<int>(kept_.size()) - first_seen_;
  if (seen <= 64) return find_few_neighbours(seen);
  sightings_.clear();
  for (std::size_t i = 0; i < plan_count_; ++i) {
    const TablePlan& plan = plans_[i];
    const std::size_t n = plan.arguments.size();
    for (std::size_t r = 0; r < plan.rows.size(); ++r) {
      if (plan.landmark[r] < 0) continue;
      for (std::size_t a = 0; a < n; ++a) {
        const Target& t = plan.targets[r * n + a];
        if (t.kind == Target::Kind::kept) sightings_.emplace_back(plan.landmark[r], t.index);
      }
    }
  }
  count_.assign(landmarks_.size() + 1, 0);  // counting sort by landmark; short lists are sorted in place
  for (const auto& s : sightings_) ++count_[s.first + 1];
  for (std::size_t l = 0; l < landmarks_.size(); ++l) count_[l + 1] += count_[l];
  neighbours_.resize(sightings_.size());
  for (std::size_t l = 0; l < landmarks_.size(); ++l) landmarks_[l].first_neighbour = count_[l];
  for (const auto& s : sightings_) neighbours_[count_[s.first]++] = s.second;
  std::int32_t end = 0;
  for (std::size_t l = 0; l < landmarks_.size(); ++l) {
    LandmarkBlock& b = landmarks_[l];
    const auto first = neighbours_.begin() + b.first_neighbour, last = neighbours_.begin() + count_[l];
    std::sort(first, last);
    const auto unique_end = std::unique(first, last);
    b.neighbours = static_cast<std::int32_t>(unique_end - first);
    std::copy(first, unique_end, neighbours_.begin() + end);
    b.first_neighbour = end;
    end += b.neighbours;
  }
  neighbours_.resize(end);
}

void LinearStructure::find_few_neighbours(int seen) {
  seen_by_.assign(landmarks_.size(), 0);
  for (std::size_t i = 0; i < plan_count_; ++i) {
    const TablePlan& plan = plans_[i];
    const std::size_t n = plan.arguments.size();
    for (std::size_t a = 0; a < n; ++a) {
      if (plan.arguments[a].landmark_type && n == 1) continue;
      for (std::size_t r = 0; r < plan.rows.size(); ++r) {
        const Target& t = plan.targets[r * n + a];
        if (plan.landmark[r] >= 0 && t.kind == Target::Kind::kept)
          seen_by_[plan.landmark[r]] |= std::uint64_t{1} << (t.index - first_seen_);
      }
    }
  }
  neighbours_.clear();
  for (std::size_t l = 0; l < landmarks_.size(); ++l) {
    landmarks_[l].first_neighbour = static_cast<std::int32_t>(neighbours_.size());
    landmarks_[l].neighbours = std::popcount(seen_by_[l]);
    for (int k = 0; k < seen; ++k)
      if (seen_by_[l] >> k & 1) neighbours_.push_back(first_seen_ + k);
  }
}

void LinearStructure::choose_panel() {
  double sparse = 0.0, tall = 0.0;
  for (LandmarkBlock& l : landmarks_) {
    l.rows = 0;
    for (int k = 0; k < l.neighbours; ++k) l.rows += kept_[neighbours_[l.first_neighbour + k]].dim;
    sparse += double(l.dim) * l.rows * (l.rows + 1);
    tall += double(l.dim) * (panel_rows() + 1) * (panel_rows() + 2);
  }
  // One product runs several times faster than scattered blocks.
  landmark_panel_ = !landmarks_.empty() && panel_rows() <= kLargestPanel && tall <= 4.0 * sparse;
  landmark_flops_ = landmark_panel_ ? tall : sparse;
}

void LinearStructure::place_landmarks() {
  choose_panel();
  landmark_store_ = 0;
  for (LandmarkBlock& l : landmarks_) {
    if (landmark_panel_) l.rows = panel_rows();
    l.data = landmark_store_;
    landmark_store_ += l.dim * l.dim + l.dim + std::int64_t{l.rows} * l.dim;
  }
  for (std::size_t i = 0; i < plan_count_; ++i) place_panel_rows(plans_[i]);
}

void LinearStructure::place_panel_rows(TablePlan& plan) {
  const std::size_t n = plan.arguments.size();
  resize_with_room(plan.panel_row, plan.rows.size() * n);
  if (landmarks_.empty()) return;
  for (std::size_t r = 0; r < plan.rows.size(); ++r) {
    if (plan.landmark[r] < 0) continue;
    const LandmarkBlock& l = landmarks_[plan.landmark[r]];
    for (std::size_t a = 0; a < n; ++a) {
      const Target& t = plan.targets[r * n + a];
      if (t.kind != Target::Kind::kept) continue;
      std::int32_t row = 0;
      if (landmark_panel_)
        row = t.offset - first_scalar_;
      else
        for (const std::int32_t* b = &neighbours_[l.first_neighbour]; *b != t.index; ++b) row += kept_[*b].dim;
      plan.panel_row[r * n + a] = row;
    }
  }
}

void LinearStructure::place_landmark_pairs() {
  landmark_pairs_.clear();
  if (landmark_panel_ || !forms_reduced_) return;  // one product of all, or none
  for (LandmarkBlock& l : landmarks_) {
    l.first_pair = static_cast<std::int64_t>(landmark_pairs_.size());
    for (int a = 0; a < l.neighbours; ++a)
      for (int b = 0; b <= a; ++b)
        landmark_pairs_.push_back(address(neighbours_[l.first_neighbour + a], neighbours_[l.first_neighbour + b]));
  }
}

}  // namespace oriel
