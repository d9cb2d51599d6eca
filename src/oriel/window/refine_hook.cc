#include "oriel/window/refine_hook.h"

#include <algorithm>
#include <cstring>

#include "oriel/residual/reprojection.h"

namespace oriel {
namespace {

template <class R>
bool read(const FactorTable& table, std::uint32_t row, R& out) {
  if (table.ops().residual != R::kName) return false;
  std::memcpy(static_cast<void*>(&out), table.measurement(row), sizeof(R));
  return true;
}

template <class V>
const V& value_at(const Graph& graph, const VariableRef& ref) {
  const VariablePool& pool = *graph.pools()[ref.pool];
  return *static_cast<const V*>(graph.find_value({pool.ops().key, pool.slots().key_of_slot(ref.slot)}));
}

VariableKey key_at(const Graph& graph, const VariableRef& ref) {
  const VariablePool& pool = *graph.pools()[ref.pool];
  return {pool.ops().key, pool.slots().key_of_slot(ref.slot)};
}

Vec3d point_of(const StereoRigd& rig, const Pose3d& anchor, const Vec2d& bearing, double rho) {
  const auto& mount = rig.cameras[0];
  const Vec3d p_camera = Vec3d{{bearing[0], bearing[1], 1.0}} / rho;
  return anchor * (mount.R_body_camera * p_camera + mount.t_body_camera);
}

}  // namespace

// A sighting from that pose of a point that is known without it.
bool RefineHook::take(const Graph& graph, FactorId id, VariableKey pose) {
  const auto table = std::find_if(graph.tables().begin(), graph.tables().end(),
                                  [&](const auto& t) { return t->ops().key == id.table; });
  if (table == graph.tables().end()) return false;
  const std::uint32_t row = (*table)->slots().find(id.key);
  if (row == SlotIndex::kNone) return false;
  const auto refs = (*table)->variables(row);
  StereoPointReprojectiond stereo_point;
  MonoPointReprojectiond mono_point;
  StereoReprojectiond stereo;
  MonoReprojectiond mono;
  PointSighting seen;
  if (read(**table, row, stereo_point) || read(**table, row, mono_point)) {
    if (!(key_at(graph, refs[0]) == pose)) return false;
    const bool both = (*table)->ops().residual == StereoPointReprojectiond::kName;
    rig_ = value_at<StereoRigd>(graph, refs[2]);
    seen = {value_at<Point3d>(graph, refs[1]).p, both ? stereo_point.pixel0 : mono_point.pixel, stereo_point.pixel1,
            both};
  } else if (read(**table, row, stereo) || read(**table, row, mono)) {
    if (!(key_at(graph, refs[1]) == pose)) return false;
    const bool both = (*table)->ops().residual == StereoReprojectiond::kName;
    rig_ = value_at<StereoRigd>(graph, refs[3]);
    const Vec3d p = point_of(rig_, value_at<Pose3d>(graph, refs[0]), both ? stereo.bearing : mono.bearing,
                             value_at<InverseDepthd>(graph, refs[2]).rho);
    seen = {p, both ? stereo.pixel0 : mono.pixel, stereo.pixel1, both};
  } else {
    return false;
  }
  known_.push_back(seen);
  factors_.push_back(id);
  return true;
}

InsertionHook::Verdict RefineHook::inserted(const Graph& graph, const States& states, const InsertedGroup& group,
                                            GraphEdit& edit) {
  const VariableKey key = states.find(poses_, group.newest, kVariableOps<Pose3d>.key);
  if (std::find(group.new_variables.begin(), group.new_variables.end(), key) == group.new_variables.end()) return {};
  const VariableId<Pose3d> pose{key.key};
  known_.clear();
  factors_.clear();
  for (const FactorId id : group.factors) take(graph, id, key);
  if (static_cast<int>(known_.size()) < options_.least_points) return {};
  const Pose3d predicted = graph.value(pose);
  Pose3d T = predicted;
  bool agreed = median_error(known_, rig_, T, work_.errors) < options_.refine_above;
  if (!agreed && agrees(find_pose(known_, rig_, options_.least_points, T, work_), options_.least_points)) {
    agreed = true;
    ++refined_;
    edit.set(pose, T);
  }
  if (!agreed) T = predicted;
  const double gate = agreed ? options_.match_gate : options_.predict_gate;
  for (std::size_t k = 0; k < known_.size(); ++k)
    if (!(error_at(known_[k], rig_, T) <= gate)) pruner_.drop(edit, factors_[k]);
  dropped_ += pruner_.dropped();
  pruner_.finish(graph, group.variables, edit);
  return {};
}

}  // namespace oriel
