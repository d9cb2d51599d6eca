// What a build of a LinearStructure remembers of the one before, where the graph is large enough for that to pay
// (structure_follow.cc).
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/base/identity.h"
#include "oriel/graph/factor_table.h"
#include "oriel/graph/ids.h"
#include "oriel/linear/ordering.h"

namespace oriel {

// Where a variable stands in the linear problem.
struct Target {
  enum class Kind : std::uint8_t { fixed, kept, landmark };
  Kind kind = Kind::fixed;
  std::int32_t index = -1;   // of the kept block, or of the landmark
  std::int32_t offset = -1;  // of its first scalar in a step: kept ones first, then landmarks
};

struct KeptBlock {
  std::int32_t dim = 0, offset = 0;
  std::uint32_t pool = 0, dense = 0;
  bool sees_landmarks = false;
};

struct FollowedStructure {
  bool is_large = false;      // this build has kept variables enough, and no landmarks
  bool is_ready = false;      // the build before has left what can be followed
  bool same_tables = false;   // it was of the same graph, which had the same tables
  bool same_targets = false;  // variables of both builds stand where they stood, but for those listed in `elsewhere`
  bool follows = false;       // this build differs little from the one before: in `changed` alone

  // What the build before saw of the graph: counts of changes, last serials, and extents.
  struct Seen {
    std::uint64_t changes = 0, last_serial = 0;
    std::uint32_t extent = 0;
  };
  Identity graph;
  std::vector<Seen> seen_pools, seen_tables;  // by place in the graph; by plan

  // What stands before the cuts stands as it did, but for where rows find the variables behind. All of it is looked at
  // where they are 0.
  std::size_t kept_cut = 0;             // kept blocks
  std::vector<std::uint32_t> pool_cut;  // dense positions, by pool
  std::vector<std::size_t> row_cut;     // rows of plans, by table

  // Of the build before, from the cuts on.
  std::size_t kept_before = 0;  // all of its kept blocks
  std::vector<KeptBlock> kept;
  std::vector<std::uint64_t> old_serials;
  std::vector<std::vector<std::uint32_t>> rows, dense;
  std::vector<const FactorTable*> tables;

  std::vector<std::uint64_t> serials;               // of the kept blocks
  std::vector<char> is_by_row, was_by_row, by_row;  // by table: whether rows are ascending; in both builds
  std::vector<std::size_t> same;                    // by table: rows from the first on that are the same factors
  std::vector<Target> before;                       // scratch: targets of rows of the build before
  std::vector<std::int32_t> prior_blocks, old_prior_blocks;
  std::size_t same_kept = 0;           // kept blocks from the first on that are the same variables
  std::vector<VariableKey> elsewhere;  // what may stand elsewhere than in the build before
  std::vector<int> changed;            // kept blocks, of both builds, whose neighbours may differ
  std::vector<char> is_changed, is_moved;
  EliminationOrder order;              // the state that `order_` stands for
  std::size_t drift = 0;               // of `order_`
  std::vector<int> place, tail_order;  // scratch of what is new
  BlockPattern tail;
  MinimumDegree degree;
};

}  // namespace oriel
