#include "apps/covariance_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oriel/io/text.h"

namespace oriel::apps {
namespace {

// Place of an id among those of the file, which are ascending; -1: not there.
std::ptrdiff_t place_of(const std::vector<std::int64_t>& ids, std::int64_t id) {
  const auto it = std::lower_bound(ids.begin(), ids.end(), id);
  return it == ids.end() || *it != id ? -1 : it - ids.begin();
}

template <class Ids>
VariableKey key_at(const Ids& ids, std::ptrdiff_t at) {
  return ids[static_cast<std::size_t>(at)];
}

Result<VariableKey> find_variable(const BatchProblem& problem, const std::string& name) {
  const bool landmark = !name.empty() && name[0] == 'l';
  std::int64_t id = 0;
  if (parse_integer(std::string_view(name).substr(landmark ? 1 : 0), id) != NumberFault::none)
    return Error{
        ErrorCode::bad_input,
        "--covariance: expected ids such as 17 (pose, camera) or l5 (landmark, point), found " + quote_token(name)};
  const Error absent{
      ErrorCode::not_found,
      "--covariance: the file has no " + std::string(landmark ? "landmark " : "pose ") + std::to_string(id),
      problem.path};
  if (const auto* ba = std::get_if<BundleAdjustment>(&problem.ids)) {
    const auto count = static_cast<std::int64_t>(landmark ? ba->points.size() : ba->cameras.size());
    if (id < 0 || id >= count) return absent;
    return landmark ? key_at(ba->points, id) : key_at(ba->cameras, id);
  }
  const auto& file = std::get<PoseGraphFile>(problem.file);
  const std::ptrdiff_t at = place_of(landmark ? file.landmark_ids : file.ids, id);
  if (at < 0) return absent;
  if (const auto* planar = std::get_if<PoseGraph2>(&problem.ids))
    return landmark ? key_at(planar->landmarks, at) : key_at(planar->poses, at);
  const auto& spatial = std::get<PoseGraph3>(problem.ids);
  return landmark ? key_at(spatial.landmarks, at) : key_at(spatial.poses, at);
}

std::string title_of(const BatchProblem& problem, const std::string& name) {
  const bool bal = std::holds_alternative<BundleAdjustment>(problem.ids);
  if (name[0] == 'l') return (bal ? "point " : "landmark ") + name.substr(1);
  return (bal ? "camera " : "pose ") + name;
}

CovarianceBlock block_of(const BatchProblem& problem, Engine& engine, std::span<const std::string> names,
                         std::span<const VariableKey> ids) {
  CovarianceBlock block;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    block.names.push_back(title_of(problem, names[i]));
    const VariableOps& ops = *problem.graph->find_ops(ids[i].type);
    for (int k = 0; k < ops.dim; ++k) {
      const auto at = static_cast<std::size_t>(k);
      block.tangents.push_back(
          block.names.back() + ": " +
          (at < ops.tangent_names.size() ? std::string(ops.tangent_names[at]) : "tangent " + std::to_string(k)));
    }
  }
  Result<std::vector<double>> matrix = engine.joint_covariance(ids);
  if (matrix)
    block.matrix = std::move(*matrix);
  else
    block.error = matrix.error().message;
  return block;
}

}  // namespace

Result<std::vector<VariableKey>> find_variables(const BatchProblem& problem, const CovarianceRequest& request) {
  std::vector<VariableKey> ids;
  for (const std::string& name : request.names) {
    Result<VariableKey> id = find_variable(problem, name);
    if (!id) return id.error();
    ids.push_back(*id);
  }
  return ids;
}

std::vector<CovarianceBlock> covariances(const BatchProblem& problem, Engine& engine, const CovarianceRequest& request,
                                         const std::vector<VariableKey>& ids) {
  std::vector<CovarianceBlock> blocks;
  if (request.joint) {
    blocks.push_back(block_of(problem, engine, request.names, ids));
    return blocks;
  }
  for (std::size_t i = 0; i < ids.size(); ++i)
    blocks.push_back(block_of(problem, engine, {&request.names[i], 1}, {&ids[i], 1}));
  return blocks;
}

std::string covariance_text(const std::vector<CovarianceBlock>& blocks) {
  std::string out;
  for (const CovarianceBlock& b : blocks) {
    if (b.matrix.empty()) {
      out += fmt::format("  covariance of {}: none. {}\n", fmt::join(b.names, ", "), b.error);
      continue;
    }
    const std::size_t n = b.tangents.size();
    for (std::size_t i = 0; i < n; ++i)
      out += fmt::format("  sigma of {}: {:.4g}\n", b.tangents[i], std::sqrt(b.matrix[i * n + i]));
  }
  return out;
}

}  // namespace oriel::apps
