// A world in which everything is linear, so that dense least squares over all that ever came is the truth about every
// window: vectors that walk at random, measured alone, against each other and against landmarks.
#pragma once
#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <tuple>
#include <vector>

#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/window/factor_builder.h"
#include "oriel/window/state_provider.h"

namespace oriel::linear_world {

using Position = VectorNd<2>;  // of the first kind of state
using Level = VectorNd<3>;     // of the second kind, with
using Offset = VectorNd<1>;

constexpr Time at_ms(std::int64_t ms) { return {ms * 1000000}; }

// A state of two variables moves: r = [level' - level - moved; offset' - offset - drifted].
struct JointStep {
  static constexpr std::string_view kName = "test.joint_step/1";
  static constexpr int kDim = 4;
  using Variables = Types<Level, Offset, Level, Offset>;
  Vec<double, 3> moved;
  Vec<double, 1> drifted;
  template <class S>
  Vec<S, 4> operator()(const VectorN<S, 3>& x0, const VectorN<S, 1>& b0, const VectorN<S, 3>& x1,
                       const VectorN<S, 1>& b1) const {
    Vec<S, 4> r;
    r.template set_segment<3>(0, x1.v - x0.v - moved.template cast<S>());
    r.template set_segment<1>(3, b1.v - b0.v - drifted.template cast<S>());
    return r;
  }
};

// A landmark from a position: r = landmark - position - seen.
struct Sight {
  static constexpr std::string_view kName = "test.sight/1";
  using Variables = Types<Position, Point2d>;
  Vec2d seen;
  template <class S>
  Vec<S, 2> operator()(const VectorN<S, 2>& x, const Point2<S>& l) const {
    return l.p - x.v - seen.template cast<S>();
  }
};

// States of two providers against each other: r = x[0] - offset - measured.
struct Tie {
  static constexpr std::string_view kName = "test.tie/1";
  using Variables = Types<Position, Offset>;
  double measured;
  template <class S>
  S operator()(const VectorN<S, 2>& x, const VectorN<S, 1>& b) const {
    return x.v[0] - b.v[0] - measured;
  }
};

// Increments with stamps, each of what was moved since the stamp before. Between two stamps the motion is even and its
// variance grows evenly, so that a motion that is split adds up to the whole.
template <int D>
class Increments {
 public:
  static constexpr double kVariance = 0.04;  // of each scalar [1/s]

  void begin(Time time) { stamps_.assign(1, {time, Vec<double, D>::zero()}); }
  void add(Time time, const Vec<double, D>& moved) { stamps_.push_back({time, moved}); }
  bool covers(Time from, Time to) const {
    return !stamps_.empty() && stamps_.front().time <= from && to <= stamps_.back().time;
  }
  Time first() const { return stamps_.front().time; }
  Time last() const { return stamps_.back().time; }
  Vec<double, D> between(Time from, Time to) const {
    Vec<double, D> sum = Vec<double, D>::zero();
    for (std::size_t k = 1; k < stamps_.size(); ++k) {
      const Time a = std::max(stamps_[k - 1].time, from), b = std::min(stamps_[k].time, to);
      if (a < b) sum += stamps_[k].moved * ((b - a).seconds() / (stamps_[k].time - stamps_[k - 1].time).seconds());
    }
    return sum;
  }
  static double sigma(Time from, Time to) { return std::sqrt(kVariance * (to - from).seconds()); }
  void forget_before(Time time) {
    std::size_t n = 0;
    while (n + 1 < stamps_.size() && stamps_[n + 1].time <= time) ++n;
    stamps_.erase(stamps_.begin(), stamps_.begin() + static_cast<std::ptrdiff_t>(n));
  }
  std::size_t size() const { return stamps_.size(); }

 private:
  struct Stamp {
    Time time;
    Vec<double, D> moved;
  };
  std::vector<Stamp> stamps_;
};

constexpr double kFirstSigma = 0.5;  // of the first state of each kind; its prior is at zero

// Faults of a provider, for tests.
struct Faults {
  int link_fails_in = -1;  // this many calls of link() go well, the next one fails; negative: none does
  int link_nan_in = -1;
  bool now(int& in) { return in >= 0 && in-- == 0; }
};

class PositionProvider final : public StateProvider {
 public:
  Increments<2> moved;
  Faults faults;

  std::string_view name() const override { return "position"; }
  std::span<const VariableOps* const> variables() const override { return kOps; }
  bool can_begin(Time time) const override { return moved.covers(time, time); }
  Result<void> begin(GraphEdit& edit, State& state) override {
    const auto x = edit.add(Position{});
    edit.add(Prior{Position{}}, Sigma(kFirstSigma), x);
    state.count = 1;
    state.variables[0] = x;
    return {};
  }
  bool covers(Time from, Time to) const override { return moved.covers(from, to); }
  Result<void> predict(GraphEdit& edit, const State& from, State& state) override {
    const Position x = edit.value(VariableId<Position>{from.variables[0].key});
    state.count = 1;
    state.variables[0] = edit.add(x.plus(moved.between(from.time, state.time)));
    return {};
  }
  Result<FactorId> link(GraphEdit& edit, const State& from, const State& to) override {
    if (faults.now(faults.link_fails_in)) return Error{ErrorCode::bad_input, "no motion today"};
    Position step{moved.between(from.time, to.time)};
    if (faults.now(faults.link_nan_in)) step.v[1] = std::nan("");
    return edit.add(Between{step}, Sigma(moved.sigma(from.time, to.time)), VariableId<Position>{from.variables[0].key},
                    VariableId<Position>{to.variables[0].key});
  }
  void forget_before(Time time) override { moved.forget_before(time); }

 private:
  static constexpr std::array<const VariableOps*, 1> kOps = {&kVariableOps<Position>};
};

class LevelProvider final : public StateProvider {
 public:
  Increments<4> moved;

  std::string_view name() const override { return "level"; }
  std::span<const VariableOps* const> variables() const override { return kOps; }
  bool can_begin(Time time) const override { return moved.covers(time, time); }
  Result<void> begin(GraphEdit& edit, State& state) override {
    const auto x = edit.add(Level{});
    const auto b = edit.add(Offset{});
    edit.add(Prior{Level{}}, Sigma(kFirstSigma), x);
    edit.add(Prior{Offset{}}, Sigma(kFirstSigma), b);
    keep(state, x, b);
    return {};
  }
  bool covers(Time from, Time to) const override { return moved.covers(from, to); }
  Result<void> predict(GraphEdit& edit, const State& from, State& state) override {
    const Vec<double, 4> step = moved.between(from.time, state.time);
    keep(state, edit.add(edit.value(level(from)).plus(step.segment<3>(0))),
         edit.add(edit.value(offset(from)).plus(step.segment<1>(3))));
    return {};
  }
  Result<FactorId> link(GraphEdit& edit, const State& from, const State& to) override {
    const Vec<double, 4> step = moved.between(from.time, to.time);
    return edit.add(JointStep{step.segment<3>(0), step.segment<1>(3)}, Sigma(moved.sigma(from.time, to.time)),
                    level(from), offset(from), level(to), offset(to));
  }
  void forget_before(Time time) override { moved.forget_before(time); }
  static VariableId<Level> level(const State& s) { return {s.variables[0].key}; }
  static VariableId<Offset> offset(const State& s) { return {s.variables[1].key}; }

 private:
  static void keep(State& state, VariableId<Level> x, VariableId<Offset> b) {
    state.count = 2;
    state.variables[0] = x;
    state.variables[1] = b;
  }
  static constexpr std::array<const VariableOps*, 2> kOps = {&kVariableOps<Level>, &kVariableOps<Offset>};
};

// A scalar or vector that is estimated, by what it is and not by an id of a window.
enum class What { position, level, offset, landmark };
struct Unknown {
  What what = What::position;
  std::int64_t number = 0;                           // the time [ns] of a state; else which landmark
  auto operator<=>(const Unknown&) const = default;  // NOLINT(modernize-use-nullptr): clang-tidy 14 means its 0
  int dim() const { return what == What::level ? 3 : what == What::offset ? 1 : 2; }
};

// Dense least squares: Σ sign_k x_k = z, each with a sigma.
class DenseTruth {
 public:
  struct Term {
    Unknown of;
    double sign = 1.0;
    int scalar = -1;  // of its scalars this one alone; -1: all
  };
  void add(std::vector<Term> terms, Eigen::VectorXd z, double sigma) {
    rows_.push_back({std::move(terms), std::move(z), sigma});
  }
  std::map<Unknown, Eigen::VectorXd> solve() const {
    std::map<Unknown, int> at;
    int n = 0, m = 0;
    for (const Row& row : rows_) {
      for (const Term& t : row.terms)
        if (at.emplace(t.of, n).second) n += t.of.dim();
      m += static_cast<int>(row.z.size());
    }
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(m, n);
    Eigen::VectorXd b(m);
    int r = 0;
    for (const Row& row : rows_) {
      const int d = static_cast<int>(row.z.size());
      for (const Term& t : row.terms)
        for (int i = 0; i < d; ++i) A(r + i, at[t.of] + (t.scalar >= 0 ? t.scalar : i)) += t.sign / row.sigma;
      b.segment(r, d) = row.z / row.sigma;
      r += d;
    }
    const Eigen::VectorXd x = A.householderQr().solve(b);
    std::map<Unknown, Eigen::VectorXd> out;
    for (const auto& [unknown, first] : at) out[unknown] = x.segment(first, unknown.dim());
    return out;
  }

 private:
  struct Row {
    std::vector<Term> terms;
    Eigen::VectorXd z;
    double sigma;
  };
  std::vector<Row> rows_;
};

}  // namespace oriel::linear_world
