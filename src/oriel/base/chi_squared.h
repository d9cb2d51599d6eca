// The χ² distribution: what squared whitened residuals follow where the model is right.
#pragma once

namespace oriel {

// P(χ² with `dof` degrees of freedom ≤ x): the regularized incomplete gamma function P(dof/2, x/2) (DLMF 8.2.4). 0 for
// x ≤ 0. dof ≥ 1.
double chi_squared_probability(double x, int dof);

// The x that χ² stays below with that probability, 0 < p < 1.
double chi_squared_threshold(double probability, int dof);

}  // namespace oriel
