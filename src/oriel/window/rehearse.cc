#include "oriel/window/rehearse.h"

#include <vector>

#include "oriel/residual/between.h"
#include "oriel/residual/imu_residual.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/reprojection.h"

namespace oriel {
namespace {

struct State {
  VariableId<Pose3d> pose;
  VariableId<Velocity3d> velocity;
  VariableId<ImuBiasd> bias;
};

struct Sight {
  FactorId factor;
  std::size_t state;
  std::size_t anchor;
  VariableId<InverseDepthd> landmark;
  VariableId<Point3d> point;
  Vec2d bearing;
};

struct Scene {
  int priors = 0;      // on variables of the first state, which is held where there are none
  bool dense = false;  // all landmarks in view of all states; else most in view of two
  bool stereo = true;  // both cameras, and the left one alone besides
  bool rest = false;   // each state is held
};

class Rehearsal {
 public:
  Rehearsal(WindowCore& window, const StereoRigd& rig, const WindowSize& size)
      : window_(window), rig_(rig), size_(size) {}

  // Which tables there are decides which place in the engine's memory each has, so that the window is built with the
  // priors of a start at rest, of one in motion, and of a window whose first state has left, then for one camera; and
  // with a body that stands still.
  bool operator()() {
    for (const Scene& scene : {Scene{3, false, true}, Scene{2, false, true}, Scene{0, true, true},
                               Scene{0, true, false}, Scene{3, false, true, true}, Scene{0, true, true, true}}) {
      if (scene.rest && !size_.holds_rest) continue;
      build(scene);
      if (!(commit() && solve() && gate() && solve())) return false;
      if (scene.priors == 3 && !(slide(SquareRootMethod::schur) && solve() && slide(SquareRootMethod::schur) &&
                                 solve() && slide(SquareRootMethod::qr) && solve()))
        return false;
      if (!thin_out() || !window_.clear()) return false;
    }
    return true;
  }

 private:
  bool commit() { return window_.commit().ok(); }
  bool solve() { return !window_.solve({.max_iterations = 2, .trace = false}).failed(); }

  static Pose3d pose(std::size_t k) { return {Rot3d{}, {{0.05 * static_cast<double>(k), 0.0, 0.0}}}; }

  void build(const Scene& scene) {
    scene_ = scene;
    states_.clear();
    sights_.clear();
    others_.clear();
    next_ = 0;
    GraphEdit& edit = window_.edit();
    rig_id_ = edit.add(rig_);
    for (std::size_t k = 0; k < static_cast<std::size_t>(size_.states); ++k) add_state(edit, k);
    const std::size_t n = states_.size();
    for (std::size_t k = 0; k + 1 < n; ++k) {
      const int begun = k == 0 ? (scene_.dense ? 2 : 1) * size_.tracks : scene_.dense ? 0 : size_.tracks / 2;
      for (int i = 0; i < begun; ++i) add_track(edit, k, k == 0 ? n : k + 2, i);
    }
  }

  void add_state(GraphEdit& edit, std::size_t k) {
    const int priors = scene_.priors;
    const State s{edit.add(pose(k)), edit.add(Velocity3d{{{0.5, 0.0, 0.0}}}), edit.add(ImuBiasd{})};
    if (k == 0) {
      if (priors > 0) edit.add(Prior{pose(0)}, Sigma(0.01), s.pose);
      if (priors > 0) edit.add(Prior{ImuBiasd{}}, Sigma(0.01), s.bias);
      if (priors > 2) edit.add(Prior{Velocity3d{{{0.5, 0.0, 0.0}}}}, Sigma(0.01), s.velocity);
      for (const VariableKey id : {VariableKey(s.pose), VariableKey(s.velocity), VariableKey(s.bias)})
        edit.fix(id, priors == 0);
    } else {
      Preintegrator motion(ImuBiasd{}, {1e-3, 1e-2, 1e-4, 1e-3});
      for (int i = 0; i < 20; ++i) motion.step(0.005, Vec3d::zero(), {{0.0, 0.0, 9.81}});
      const State& before = states_.back();
      edit.add(ImuResiduald{motion.result().motion, kStandardGravity}, imu_noise(motion.result()),
               InertialOptions{}.loss, before.pose, before.velocity, before.bias, s.pose, s.velocity, s.bias);
      if (scene_.rest) edit.add(Prior{Velocity3d{}}, Sigma(0.01), s.velocity);
      if (scene_.rest) edit.add(Between{Pose3d{}}, Sigmas(Vec6d::constant(0.01)), before.pose, s.pose);
    }
    states_.push_back(s);
  }

  Vec3d point(std::size_t anchor, const Vec2d& bearing) const {
    return pose(anchor) * (rig_.cameras[0].T_body_camera() * Vec3d{{5.0 * bearing[0], 5.0 * bearing[1], 5.0}});
  }

  Vec2d pixel(int camera, std::size_t anchor, std::size_t at, const Vec2d& bearing) const {
    const Vec3d p_world = point(anchor, bearing);
    const auto& mount = rig_.cameras[camera];
    Vec2d out = Vec2d::zero();
    (void)mount.camera.project(mount.T_body_camera().inverse() * (pose(at).inverse() * p_world), out, nullptr);
    return out;
  }

  void add_point_track(GraphEdit& edit, std::size_t anchor, std::size_t end, const Vec2d& bearing) {
    // Not quite where it is: from the minimum no step would be tried.
    const auto landmark = edit.add(Point3d{point(anchor, bearing) * 1.001});
    const Loss loss = VisualOptions{}.loss;
    for (std::size_t k = anchor; k < end; ++k) {
      const Vec2d left = pixel(0, anchor, k, bearing), right = pixel(1, anchor, k, bearing);
      others_.push_back(edit.add(MonoPointReprojectiond{left}, Sigma(1.0), loss, states_[k].pose, landmark, rig_id_));
      if (!scene_.stereo) continue;
      const FactorId stereo =
          edit.add(StereoPointReprojectiond{left, right}, Sigma(1.0), loss, states_[k].pose, landmark, rig_id_);
      sights_.push_back({stereo, k, anchor, {}, landmark, bearing});
    }
  }

  void add_track(GraphEdit& edit, std::size_t anchor, std::size_t end, int i) {
    const Vec2d bearing = {{0.05 * (i % 13 - 6), 0.03 * (i / 13 % 13 - 6)}};
    if (size_.landmarks == LandmarkModel::point) return add_point_track(edit, anchor, end, bearing);
    const auto landmark = edit.add(InverseDepthd{0.2});
    const IsotropicNoise noise = Sigma(1.0);
    const Loss loss = VisualOptions{}.loss;
    const AnchorReprojectiond at_anchor{bearing, pixel(1, anchor, anchor, bearing)};
    if (scene_.stereo) others_.push_back(edit.add(at_anchor, noise, loss, landmark, rig_id_));
    for (std::size_t k = anchor + 1; k < end; ++k) {
      const Vec2d left = pixel(0, anchor, k, bearing), right = pixel(1, anchor, k, bearing);
      others_.push_back(edit.add(MonoReprojectiond{bearing, left}, noise, loss, states_[anchor].pose, states_[k].pose,
                                 landmark, rig_id_));
      if (!scene_.stereo) continue;
      const FactorId stereo = edit.add(StereoReprojectiond{bearing, left, right}, noise, loss, states_[anchor].pose,
                                       states_[k].pose, landmark, rig_id_);
      sights_.push_back({stereo, k, anchor, landmark, {}, bearing});
    }
  }

  // A third of the sightings lose their right camera.
  bool gate() {
    GraphEdit& edit = window_.edit();
    for (std::size_t n = 0; n < sights_.size(); n += 3) {
      const Sight& s = sights_[n];
      edit.remove(s.factor);
      if (size_.landmarks == LandmarkModel::point)
        edit.add(MonoPointReprojectiond{pixel(0, s.anchor, s.state, s.bearing)}, Sigma(1.0), VisualOptions{}.loss,
                 states_[s.state].pose, s.point, rig_id_);
      else if (s.state > 0)
        edit.add(MonoReprojectiond{s.bearing, pixel(0, 0, s.state, s.bearing)}, Sigma(1.0), VisualOptions{}.loss,
                 states_[s.state - 1].pose, states_[s.state].pose, s.landmark, rig_id_);
    }
    return commit();
  }

  bool slide(SquareRootMethod method) {
    const State& s = states_[next_++];
    const VariableKey leaving[] = {s.pose, s.velocity, s.bias};
    return window_.slide(leaving, {.method = method}).ok();
  }

  // All that is left goes factor by factor, then variable by variable: as many removals as an edit may ever hold.
  bool thin_out() {
    GraphEdit& edit = window_.edit();
    for (const Sight& s : sights_)
      if (window_.graph().contains(s.factor)) edit.remove(s.factor);
    for (const FactorId id : others_)
      if (window_.graph().contains(id)) edit.remove(id);
    return commit();
  }

  WindowCore& window_;
  StereoRigd rig_;
  WindowSize size_;
  Scene scene_;
  VariableId<StereoRigd> rig_id_;
  std::vector<State> states_;
  std::vector<Sight> sights_;     // stereo
  std::vector<FactorId> others_;  // anchors and mono
  std::size_t next_ = 0;
};

}  // namespace

bool rehearse(WindowCore& window, const StereoRigd& rig, const WindowSize& size) {
  const bool done = Rehearsal(window, rig, size)();
  (void)window.clear();
  window.begin_anew();
  return done;
}

}  // namespace oriel
