// When conjugate gradients end (linear/schur_conjugate_gradient.h).
#pragma once

namespace oriel {

struct ConjugateGradientOptions {
  // Ends where a step of it gains ≤ forcing · (the mean gain so far): i (Q_i - Q_{i-1}) / Q_i (S. Nash, A. Sofer,
  // Assessing a search direction within a truncated Newton method, 1990), or at a residual below 1e-14 of b.
  double forcing = 0.01;
  int max_iterations = 500;
};

}  // namespace oriel
