// Powell's dogleg: the step of a trust region, on the path from the steepest descent's minimum to the Gauss–Newton
// step. M. Powell, A Hybrid Method for Nonlinear Equations, 1970; J. Nocedal, S. Wright, Numerical Optimization, 2nd
// edition, 2006, section 4.1 (eq. 4.16) and algorithm 4.1. Lengths are those of D p with D² = diag(H), so that the
// region does not depend on the units of the variables. A rejected step costs neither a linearization nor a
// factorization.
#pragma once
#include <vector>

namespace oriel {

class Dogleg {
 public:
  // Begins a solve.
  void start(double radius) { radius_ = radius; }
  // At a new linearization: gradient g, D² (> 0), the Gauss–Newton step p (null: there is none), H p, and for the
  // direction of steepest descent q = descent() the product H q.
  const std::vector<double>& descent(const std::vector<double>& gradient, const std::vector<double>& scale);
  void begin(const std::vector<double>& gradient, const std::vector<double>& scale, const double* p, const double* hp,
             const double* hq);

  // The step for the radius now.
  void step(std::vector<double>& out);
  double gain() const { return gain_; }  // what the linear model promises for it
  // Whether the radius cut it short: there is more to gain than it says.
  bool is_cut() const { return !has_p_ || length_ * length_ < pp_ * (1.0 - 1e-9); }
  double radius() const { return radius_; }

  void accepted(double decrease);  // of the cost
  void rejected() { radius_ = 0.25 * (length_ < radius_ ? length_ : radius_); }

 private:
  void combine(double a, double b, std::vector<double>& out);  // a q + b p

  double radius_ = 0.0, gain_ = 0.0, length_ = 0.0;
  std::vector<double> q_, p_;
  bool has_p_ = false;
  // Products of q and p: with g, through H, and through D².
  double gq_ = 0.0, gp_ = 0.0, qhq_ = 0.0, qhp_ = 0.0, php_ = 0.0, qq_ = 0.0, qp_ = 0.0, pp_ = 0.0;
};

}  // namespace oriel
