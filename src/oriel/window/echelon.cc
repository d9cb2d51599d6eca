#include "oriel/window/echelon.h"

#include <algorithm>
#include <cmath>

#include "oriel/linear/dot.h"

namespace oriel {

int reduce_to_echelon(const StackedColumns& a, int from, int to, int end, int used, char* empty) {
  if (used == a.rows) std::fill(empty + from, empty + to, 1);
  for (int c = from; c < to && used < a.rows; ++c) {
    double* const v = a.column(c);
    const int left = a.rows - used;
    const double whole = std::sqrt(dot(v, v, a.rows)), norm = std::sqrt(dot(v + used, v + used, left));
    if (!(norm > kNegligibleColumn * whole)) {
      empty[c] = 1;
      std::fill(v + used, v + a.rows, 0.0);
      continue;
    }
    const double beta = v[used] > 0.0 ? -norm : norm, v0 = v[used] - beta, scale = 1.0 / (beta * v0);
    v[used] = v0;
    for (int j = c + 1; j < end; ++j) {
      double* const x = a.column(j) + used;
      const double s = scale * dot(v + used, x, left);
      if (s == 0.0) continue;
      for (int i = 0; i < left; ++i) x[i] += s * v[used + i];
    }
    v[used] = beta;
    std::fill(v + used + 1, v + a.rows, 0.0);
    if (++used == a.rows) std::fill(empty + c + 1, empty + to, 1);
  }
  return used;
}

}  // namespace oriel
