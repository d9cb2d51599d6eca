#include "benchmarks/support/window_work.h"

#include <algorithm>
#include <map>

#include "benchmarks/support/counted.h"
#include "oriel/residual/reprojection.h"

namespace oriel::benchmark {
namespace {

// Flops of one row: of the residual alone, and with its Jacobian.
struct RowFlops {
  double residual = 0.0, both = 0.0;
};

// Values at which no formula takes a short cut.
Pose3<Counted> some_pose(double x) {
  const Pose3d p{Rot3d::exp({{0.1 * x, 0.2, -0.1}}), {{x, 0.1, 0.2}}};
  Pose3<Counted> out;
  out.R.qw = p.R.qw, out.R.qx = p.R.qx, out.R.qy = p.R.qy, out.R.qz = p.R.qz;
  for (int i = 0; i < 3; ++i) out.t[i] = p.t[i];
  return out;
}
template <class F>
double count(F&& f) {
  Counted::flops = 0;
  f();
  return static_cast<double>(Counted::flops);
}

template <class R, int D>
RowFlops of_pair() {
  R m{};
  const Pose3<Counted> a = some_pose(0.0), b = some_pose(0.1);
  InverseDepth<Counted> depth;
  depth.rho = 0.3;
  StereoRig<Counted> rig;
  Vec<Counted, D> r;
  Mat<Counted, D, 6> J_a, J_b;
  Mat<Counted, D, 1> J_depth;
  return {count([&] { m.evaluate(a, b, depth, rig, r, nullptr, nullptr, nullptr); }),
          count([&] { m.evaluate(a, b, depth, rig, r, &J_a, &J_b, &J_depth); })};
}
RowFlops of_anchor() {
  AnchorReprojection<Counted> m{};
  InverseDepth<Counted> depth;
  depth.rho = 0.3;
  StereoRig<Counted> rig;
  Vec<Counted, 2> r;
  Mat<Counted, 2, 1> J;
  return {count([&] { m.evaluate(depth, rig, r, nullptr); }), count([&] { m.evaluate(depth, rig, r, &J); })};
}
RowFlops of_imu() {
  ImuResidual<Counted> m{};
  const Pose3<Counted> a = some_pose(0.0), b = some_pose(0.1);
  Velocity3<Counted> v{};
  ImuBias<Counted> bias{};
  for (int i = 0; i < 3; ++i) v.v[i] = 0.1, bias.gyro[i] = 0.02, bias.accel[i] = 0.1, m.motion.dR_dg(i, i) = -0.25;
  Vec<Counted, 15> r;
  Mat<Counted, 15, 6> J1, J3, J4, J6;
  Mat<Counted, 15, 3> J2, J5;
  return {count([&] { m.evaluate(a, v, bias, b, v, bias, r, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr); }),
          count([&] { m.evaluate(a, v, bias, b, v, bias, r, &J1, &J2, &J3, &J4, &J5, &J6); })};
}

// A kind of factor: how many, residual rows, columns of J, numbers that a row keeps.
struct Kind {
  double count = 0;
  int dim = 0, cols = 0, numbers = 0;
  RowFlops row;
  int noise = 1;  // entries of the whitening matrix that a residual is multiplied by, a row

  double whiten(int columns) const { return noise == 1 ? 1.0 * dim * columns : 2.0 * noise * columns; }
  double residual_flops() const { return row.residual + whiten(1) + 2.0 * dim + 10.0; }  // squared norm and loss
  // With √ρ' and the products JᵀJ, Jᵀr.
  double jacobian_flops() const {
    return row.both + whiten(cols + 1) + dim * cols + 2.0 * dim * (cols * (cols + 1) / 2.0 + cols);
  }
};

struct Kinds {
  Kind pair, anchor, imu;
  explicit Kinds(const WindowOptions& options) {
    const bool stereo = options.stereo;
    pair.dim = stereo ? 4 : 2, pair.cols = 13, pair.numbers = stereo ? 10 : 8;
    pair.row = stereo ? of_pair<StereoReprojection<Counted>, 4>() : of_pair<MonoReprojection<Counted>, 2>();
    anchor.dim = 2, anchor.cols = 1, anchor.numbers = 8, anchor.row = of_anchor();
    imu.dim = 15, imu.cols = 30, imu.numbers = 65 + 120, imu.row = of_imu(), imu.noise = 120;
  }
};

}  // namespace

WindowCounts count_window(const WindowData& data, const WindowOptions& options, int newest, bool keyframe) {
  WindowCounts c;
  c.states = options.window;
  const int oldest = newest - options.window + 1;
  std::map<int, int> seen;  // by track: states that see it besides its anchor
  auto add = [&](const std::vector<View>& views) {
    for (const View& view : views) {
      const int anchor = data.stream.tracks[static_cast<std::size_t>(view.track)].anchor;
      if (anchor < oldest) continue;
      int& others = seen[view.track];
      if (view.keyframe == anchor)
        ++c.anchors;
      else
        ++others, ++c.pairs, c.leaving_pairs += anchor == oldest;
    }
  };
  for (int k = std::max(oldest, 0); k < newest + (keyframe ? 1 : 0); ++k) add(data.views[static_cast<std::size_t>(k)]);
  if (!keyframe) add(data.between_views[static_cast<std::size_t>(newest - 1)]);
  for (const auto& [track, others] : seen) {
    const double n = 6.0 * (others + 1);
    const bool leaves = data.stream.tracks[static_cast<std::size_t>(track)].anchor == oldest;
    ++c.landmarks;
    c.schur_entries += n * (n + 1);
    c.schur_scalars += n;
    c.leaving_landmarks += leaves;
    c.leaving_entries += leaves ? n * (n + 1) : 0.0;
  }
  return c;
}

WindowWork window_work(const WindowCounts& c, const WindowOptions& options, double factor_flops, bool keyframe) {
  Kinds kinds(options);
  kinds.pair.count = c.pairs, kinds.anchor.count = c.anchors, kinds.imu.count = c.states - 1;
  const double iterations = options.iterations, n = c.prior_dim(), kept = c.kept_dim();
  const double matrix = 8.0 * kept * (kept + 1) / 2, store = 8.0 * (c.schur_scalars + 2.0 * c.landmarks);
  WindowWork w;
  for (const Kind* k : {&kinds.pair, &kinds.anchor, &kinds.imu}) {
    w.evaluate.flops += (iterations + 1) * k->count * k->residual_flops();
    w.evaluate.bytes += (iterations + 1) * k->count * 8.0 * (k->numbers + 2 * k->dim + 2);
    w.linearize.flops += iterations * k->count * k->jacobian_flops();
    w.linearize.bytes += iterations * k->count * 8.0 * (k->numbers + k->dim + 2.0 * k->dim * k->cols);
  }
  w.evaluate.flops += (iterations + 1) * n * n;                   // of the prior: R e, R upper triangular
  w.linearize.flops += iterations * n * n + n * (n + 1) * n / 3;  // Rᵀr, and RᵀR once
  w.linearize.bytes += iterations * 2 * (matrix + store) + 8.0 * n * n;
  w.eliminate = {iterations * (c.schur_entries + 3 * c.schur_scalars), iterations * (2 * matrix + store)};
  w.factor = {iterations * factor_flops, iterations * 2 * matrix};
  w.solve = {iterations * (2 * kept * kept + 2 * c.schur_scalars), iterations * (2 * matrix + store)};
  if (!keyframe) return w;
  double leaving = 0.0;  // Cholesky of the 15 columns that leave
  for (int i = 0; i < 15; ++i) leaving += (15 + n - i) * (15 + n - i);
  w.fold.flops = c.leaving_pairs * kinds.pair.jacobian_flops() + c.leaving_landmarks * kinds.anchor.jacobian_flops() +
                 kinds.imu.jacobian_flops() + c.leaving_entries + n * (n + 1) * n / 3 + leaving + n * n * n / 3;
  w.fold.bytes = 8.0 * (c.leaving_pairs * kinds.pair.cols * kinds.pair.dim + 3.0 * (n + 15) * (n + 15));
  return w;
}

}  // namespace oriel::benchmark
