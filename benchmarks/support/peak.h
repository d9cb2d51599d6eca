// What this core can do at most, measured: what the stages of a solver are held against.
#pragma once

namespace oriel::benchmark {

double fused_multiply_add_peak();  // [flop/s], registers alone
double matrix_product_rate();      // [flop/s], a 384 × 384 product of doubles by Eigen

}  // namespace oriel::benchmark
