#include "oriel/residual/loss.h"

namespace oriel::detail {
namespace {

LossValue<double> geman_mcclure(double c2, double s) {
  const double w = c2 / (c2 + s);
  return {w * s, w * w};
}

LossValue<double> tukey(double c2, double s) {
  if (s >= c2) return {c2 / 3.0, 0.0};
  const double u = s / c2;
  return {s * (1.0 - u + u * u / 3.0), (1.0 - u) * (1.0 - u)};
}

LossValue<double> truncated(double c2, double mu, double s) {
  if (std::isinf(mu)) return s <= c2 ? LossValue<double>{s, 1.0} : LossValue<double>{c2, 0.0};
  if (s <= c2 * mu / (mu + 1.0)) return {s, 1.0};
  if (s >= c2 * (mu + 1.0) / mu) return {c2, 0.0};
  const double root = std::sqrt(c2 * mu * (mu + 1.0) / s);
  return {2.0 * root * s - mu * (c2 + s), root - mu};
}

// b/α ((u + 1)^(α/2) - 1) by expm1 and log1p, so that α ≈ 0 and small residuals keep their digits.
LossValue<double> barron(double c2, double alpha, double s) {
  if (alpha >= 2.0) return {s, 1.0};
  if (std::isinf(alpha)) return {-2.0 * c2 * std::expm1(-0.5 * s / c2), std::exp(-0.5 * s / c2)};
  const double b = 2.0 - alpha, log_u = std::log1p(s / (c2 * b)), power = 0.5 * alpha * log_u;
  const double grown = std::abs(alpha) < 1e-12 ? 0.5 * log_u : std::expm1(power) / alpha;
  return {2.0 * c2 * b * grown, std::exp(power - log_u)};
}

}  // namespace

LossValue<double> evaluate_redescending(const Loss& loss, double s) noexcept {
  const double c2 = loss.scale * loss.scale;
  switch (loss.kind) {
    case LossKind::geman_mcclure:
      return geman_mcclure(c2, s);
    case LossKind::tukey:
      return tukey(c2, s);
    case LossKind::truncated:
      return truncated(c2, loss.shape, s);
    case LossKind::barron:
      return barron(c2, loss.shape, s);
    default:
      return {s, 1.0};
  }
}

}  // namespace oriel::detail
