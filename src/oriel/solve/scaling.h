// In what units a step is long: D², of the damping λ D² and of the dogleg's region.
#pragma once
#include <algorithm>
#include <cstddef>
#include <vector>

namespace oriel {

// D² = diag(H), but falling no more than tenfold from one linearization to the next. J. Moré, "The Levenberg-Marquardt
// Algorithm: Implementation and Theory", 1978, section 6, never lets it fall. It must not collapse where a step lands
// on a plateau, or the next leads out of sight (NIST's BoxBOD, MGH17); but the steepness of a start must not shackle a
// scalar for good either (NIST's MGH10 then crawls). `remember`: `scale` is that of the linearization before.
inline void scale_by_diagonal(const std::vector<double>& diagonal, bool remember, std::vector<double>& scale) {
  constexpr double kLeast = 1e-6, kLargest = 1e32, kMemory = 0.1;
  if (!remember) scale.assign(diagonal.size(), 0.0);
  for (std::size_t i = 0; i < scale.size(); ++i)
    scale[i] = std::clamp(std::max(kMemory * scale[i], diagonal[i]), kLeast, kLargest);
}

}  // namespace oriel
