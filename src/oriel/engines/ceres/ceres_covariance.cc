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
  std::vector<std::size_t> rows;      // of `out`, of each of their scalars
  std::size_t row = 0;
  for (const VariableKey& id : ids) {
    const HeldVariable& v = *find(id);
    const auto dim = static_cast<std::size_t>(v.ops->dim);
    if (!v.fixed && dim > 0) {
      blocks.push_back(v.value.data());
      for (std::size_t k = 0; k < dim; ++k) rows.push_back(row + k);
    }
    row += dim;
  }
  if (blocks.empty()) return true;
  if (!touches_all()) return false;
  const Silence silence;
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  ceres::Covariance covariance(options);
  std::vector<double> found(rows.size() * rows.size());
  if (!covariance.Compute(blocks, problem_.get()) ||
      !covariance.GetCovarianceMatrixInTangentSpace(blocks, found.data()))
    return false;
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t j = 0; j < rows.size(); ++j) out[rows[j] * n + rows[i]] = found[j * rows.size() + i];
  return true;
}

}  // namespace oriel::ceres_detail
