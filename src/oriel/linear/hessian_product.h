// y = H x where no factorization is asked: how far down the gradient points (Powell's dogleg), conjugate gradients, and
// what an undetermined direction moves.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/linear/linearize.h"

namespace oriel {

class HessianProduct {
 public:
  // Lists the blocks, once a structure.
  void prepare(const LinearStructure& structure);

  // Kept with kept alone; `h` in the layout of the factorization, x and y kept_dim() values in the order of a step.
  void kept(const double* h, const double* x, double* y) const;
  // The whole of it, landmarks too: dim() values.
  void whole(const LinearStructure& structure, const LinearSystem& system, const double* x, double* y);

  // The neighbours of a landmark stand apart in a step, and side by side in the rows of its W: gather takes l.rows
  // values of x from there, scatter adds as many to y.
  static void gather(const LinearStructure& structure, const LandmarkBlock& l, const double* x, double* out);
  static void scatter(const LinearStructure& structure, const LandmarkBlock& l, const double* in, double* y);

 private:
  struct Block {
    std::int64_t offset;  // of its first entry in h
    std::int32_t ld, rows, cols, row, col;
    bool transposed, diagonal;
  };
  std::vector<Block> blocks_;
  std::vector<double> near_x_, near_y_;  // of a landmark's neighbours
  std::uint64_t version_ = 0;
  int kept_dim_ = 0;
};

}  // namespace oriel
