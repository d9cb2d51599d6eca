// Elimination orders of a block pattern that keep the fill small. Deterministic: functions of the pattern alone.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/linear/block_pattern.h"

namespace oriel {

enum class OrderingMethod {
  given,              // the caller's order; windows use it
  minimum_degree,     // approximate minimum degree
  nested_dissection,  // METIS, where the build has it, else minimum degree
  automatic,          // minimum degree, and nested dissection as well where the work pays for trying
};

// How the reduced system, what is left when landmarks are eliminated, is solved. Without landmarks: direct.
enum class LinearSolver {
  direct,              // formed and factored
  conjugate_gradient,  // not formed: products alone (linear/schur_conjugate_gradient.h)
  automatic,           // whichever the sizes say is quicker
};

// The order in which the variables of a large graph are eliminated: state, not a cache (decision 6), as it depends on
// when it was made and added to. Each build leaves out what is gone and puts what is new behind the rest. It is made
// anew where it leaves twice the work that it left when it was made, or as many variables have come and gone since as
// it was made of: points that the state and the graph alone decide.
struct EliminationOrder {
  OrderingMethod method = OrderingMethod::automatic;
  std::vector<std::uint64_t> serials;  // of variables, the first eliminated first; empty: none was made
  double flops = 0.0;                  // of a factorization when it was made
  std::uint64_t made = 0;              // how often
  std::uint64_t made_of = 0;           // variables that it had then
  std::uint64_t drift = 0;             // variables that came or went since
  bool operator==(const EliminationOrder&) const = default;
};

// Approximate minimum degree on the quotient graph of the blocks, each weighted by its dimension: P. Amestoy, T. Davis,
// I. Duff, "An approximate minimum degree ordering algorithm", SIAM J. Matrix Anal. Appl. 17 (1996), with element
// absorption, mass elimination, indistinguishable variables and the degree bound of its section 4.
class MinimumDegree {
 public:
  // order[k] is the block that is eliminated k-th. Blocks from `first_late` on, the newest of a graph that grows at
  // that end, come after all others (but for those that go without fill before): what is tied to them later then
  // reaches little of the tree.
  void order(const BlockPattern& pattern, std::vector<int>& order, int first_late = kNoneLate);
  static constexpr int kNoneLate = 0x7fffffff;

 private:
  enum class Kind : unsigned char { variable, element, gone };
  void start(const BlockPattern& pattern);
  void set_dense_aside(const BlockPattern& pattern);
  int pop_least();
  void release_late();
  void list_by_degree(int i);
  void unlist(int i);
  void gather_element(int p);
  void measure_elements(int p);
  void update_variables(int p);
  void update_variable(int p, int i);
  void merge_indistinguishable();
  void merge_bucket(int first);
  bool same_lists(int i, int j) const;
  void finish_element(int p);
  void append(int to, int from);

  int first_late_ = kNoneLate;             // blocks from here on are in no list of degrees yet
  int n_ = 0, remaining_ = 0, least_ = 0;  // blocks; dimension not yet eliminated; no degree below is in use
  std::int64_t stamp_ = 0;
  std::vector<Kind> kind_;
  // Lists: of a variable, its elements and then its variables; of an element, its variables.
  std::vector<int> lists_, begin_, length_, elements_;
  std::vector<int> weight_;  // dimension of a variable with all that were merged into it; 0: merged; < 0: in L_p
  std::vector<int> degree_;  // bound of a variable's degree; of an element, the weight of its variables
  std::vector<int> head_, next_, previous_;  // doubly linked lists of variables, by degree
  std::vector<std::int64_t> outside_;        // weight of L_e \ L_p, plus stamp_
  std::vector<std::int64_t> mark_;
  std::vector<int> chain_next_, chain_last_;  // what is eliminated together with a variable
  std::vector<int> hash_head_, hash_next_, hash_, used_hashes_;
  std::vector<int> dense_;
};

// METIS's nested dissection; false where the build has none or it fails, and `order` is then unchanged.
bool nested_dissection(const BlockPattern& pattern, std::vector<int>& order);

}  // namespace oriel
