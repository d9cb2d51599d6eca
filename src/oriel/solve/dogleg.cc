#include "oriel/solve/dogleg.h"

#include <algorithm>
#include <cmath>

namespace oriel {

// q = -D⁻² g.
const std::vector<double>& Dogleg::descent(const std::vector<double>& gradient, const std::vector<double>& scale) {
  q_.resize(gradient.size());
  for (std::size_t i = 0; i < q_.size(); ++i) q_[i] = -gradient[i] / scale[i];
  return q_;
}

void Dogleg::begin(const std::vector<double>& gradient, const std::vector<double>& scale, const double* p,
                   const double* hp, const double* hq) {
  has_p_ = p != nullptr;
  gq_ = gp_ = qhq_ = qhp_ = php_ = qq_ = qp_ = pp_ = 0.0;
  p_.resize(q_.size());
  for (std::size_t i = 0; i < q_.size(); ++i) {
    gq_ += gradient[i] * q_[i];
    qhq_ += q_[i] * hq[i];
    qq_ += q_[i] * scale[i] * q_[i];
    if (!has_p_) continue;
    p_[i] = p[i];
    gp_ += gradient[i] * p[i];
    qhp_ += p[i] * hq[i];
    php_ += p[i] * hp[i];
    qp_ += q_[i] * scale[i] * p[i];
    pp_ += p[i] * scale[i] * p[i];
  }
}

void Dogleg::step(std::vector<double>& out) {
  if (has_p_ && std::sqrt(pp_) <= radius_) return combine(0.0, 1.0, out);
  const double t = qhq_ > 0.0 ? -gq_ / qhq_ : HUGE_VAL;  // the minimum along q
  if (!has_p_ || t * std::sqrt(qq_) >= radius_) return combine(std::min(t, radius_ / std::sqrt(qq_)), 0.0, out);
  // On the way from t q to p: ‖D (t q + β (p - t q))‖ = radius, the larger root β of a quadratic.
  const double a = pp_ - 2.0 * t * qp_ + t * t * qq_, b = t * qp_ - t * t * qq_, c = t * t * qq_ - radius_ * radius_;
  const double root = std::sqrt(std::max(0.0, b * b - a * c));
  const double beta = std::clamp(b > 0.0 ? -c / (b + root) : (root - b) / a, 0.0, 1.0);
  combine(t * (1.0 - beta), beta, out);
}

void Dogleg::combine(double a, double b, std::vector<double>& out) {
  for (std::size_t i = 0; i < q_.size(); ++i) out[i] = a * q_[i] + (b != 0.0 ? b * p_[i] : 0.0);
  length_ = std::sqrt(std::max(0.0, a * a * qq_ + 2.0 * a * b * qp_ + b * b * pp_));
  gain_ = -(a * gq_ + b * gp_) - 0.5 * (a * a * qhq_ + 2.0 * a * b * qhp_ + b * b * php_);
}

void Dogleg::accepted(double decrease) {
  const double ratio = decrease / gain_;
  if (ratio < 0.25)
    radius_ = 0.25 * length_;
  else if (ratio > 0.75)
    radius_ = std::max(radius_, 3.0 * length_);
}

}  // namespace oriel
