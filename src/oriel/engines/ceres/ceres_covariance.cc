// Marginal covariances by ceres::Covariance: the inverse of JᵀJ through a sparse QR of J, robust weights included, in
// the tangent space.
#include <ceres/covariance.h>
#include <glog/logging.h>

#include "oriel/engines/ceres/ceres_problem.h"

namespace oriel::ceres_detail {
namespace {

// What Ceres says of a deficient rank is said by an Error; it would print it as well.
class Silence {
 public:
  Silence() : before_(FLAGS_minloglevel) { FLAGS_minloglevel = google::GLOG_FATAL; }
  ~Silence() { FLAGS_minloglevel = before_; }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;

 private:
  google::int32 before_;
};

// A scalar of Ceres's: a direction of the tangent of a variable, whose rows begin at `row`.
struct Direction {
  std::size_t row = 0;
  std::vector<double> parts;
};

void append_directions(const HeldVariable& v, std::size_t row, std::vector<Direction>& out) {
  const auto dim = static_cast<std::size_t>(v.ops->dim);
  const auto* free = dynamic_cast<const FreeManifold*>(v.manifold.get());
  if (free == nullptr) {
    for (std::size_t k = 0; k < dim; ++k) out.push_back({row + k, {1.0}});
    return;
  }
  const std::vector<double> F = free->directions(v.value.data());
  for (auto at = F.begin(); at != F.end(); at += static_cast<std::ptrdiff_t>(dim))
    out.push_back({row, {at, at + static_cast<std::ptrdiff_t>(dim)}});
}

}  // namespace

// Ceres takes what no factor touches for known.
bool CeresProblem::touches_all() const {
  bool all = true;
  std::vector<ceres::ResidualBlockId> blocks;
  for (const auto& p : pools_)
    p->variables.for_each([&](const HeldVariable& v) {
      if (v.fixed || v.ops->dim == 0) return;
      problem_->GetResidualBlocksForParameterBlock(v.value.data(), &blocks);
      all = all && !blocks.empty();
    });
  return all;
}

bool CeresProblem::covariance(std::span<const VariableKey> ids, std::size_t n, std::vector<double>& out) {
  out.assign(n * n, 0.0);
  std::vector<const double*> blocks;  // of what may move; the rest is known for certain
  std::vector<Direction> directions;  // of each of their scalars
  std::size_t row = 0;
  for (const VariableKey& id : ids) {
    const HeldVariable& v = *find(id);
    const auto dim = static_cast<std::size_t>(v.ops->dim);
    if (!v.fixed && dim > 0) {
      blocks.push_back(v.value.data());
      append_directions(v, row, directions);
    }
    row += dim;
  }
  if (blocks.empty()) return true;
  if (!touches_all()) return false;
  const Silence silence;
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  ceres::Covariance covariance(options);
  const std::size_t m = directions.size();
  std::vector<double> found(m * m);
  if (!covariance.Compute(blocks, problem_.get()) ||
      !covariance.GetCovarianceMatrixInTangentSpace(blocks, found.data()))
    return false;
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; j < m; ++j)
      for (std::size_t r = 0; r < directions[i].parts.size(); ++r)
        for (std::size_t c = 0; c < directions[j].parts.size(); ++c)
          out[(directions[j].row + c) * n + directions[i].row + r] +=
              directions[i].parts[r] * found[j * m + i] * directions[j].parts[c];
  return true;
}

}  // namespace oriel::ceres_detail
