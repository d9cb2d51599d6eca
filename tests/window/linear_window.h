// A sliding window in the linear world: measurements go in by a builder, and what the window says is compared with
// dense least squares over all that it has taken.
#pragma once
#include <gtest/gtest.h>

#include <optional>
#include <random>
#include <unordered_map>

#include "linear_world.h"
#include "oriel/window/sliding_window.h"

namespace oriel::linear_world {

struct Measured {
  enum class Kind { position, step, sight, landmark, level, offset, tie };
  Kind kind = Kind::position;
  Time a, b;  // of its states; b of a step and, of the second provider, of a tie
  int landmark = 0;
  std::array<double, 3> z{};
  double sigma = 0.1;
  bool bad = false;    // it goes in as a NaN
  int sensor = 0;      // of a group: that of its first factor
  bool stale = false;  // its landmark's id is from before the window began anew
};
using MeasuredGroup = std::vector<Measured>;

class LinearBuilder final : public FactorBuilder {
 public:
  ProviderId positions, levels;
  std::vector<MeasuredGroup> queue;
  std::vector<MeasuredGroup> taken;
  std::vector<std::vector<FactorId>> taken_factors;  // their ids, group by group
  std::vector<MeasuredGroup> not_taken;              // where they are kept
  bool keeps_refused = false;
  std::vector<const char*> sensors = {"linear"};
  std::vector<std::optional<VariableId<Point2d>>> landmarks;
  int refusals = 0;

  std::string_view name() const override { return "linear"; }
  void drain(const Graph&, const States&, PendingFactors& pending) override {
    std::size_t kept = 0;
    for (MeasuredGroup& group : queue) {
      if (waits(group))
        std::swap(queue[kept++], group);
      else
        send(std::move(group), pending);
    }
    queue.resize(kept);
  }
  void entered(std::uint64_t number, std::span<const VariableKey> variables,
               std::span<const FactorId> factors) override {
    std::size_t next = 0;
    for (const int l : sent_[number].brings) landmarks[l] = VariableId<Point2d>{variables[next++].key};
    for (const int l : sent_[number].brings) in_flight_.erase(l);
    taken.push_back(std::move(sent_[number].group));
    taken_factors.emplace_back(factors.begin(), factors.end());
    sent_.erase(number);
  }
  void refused(std::uint64_t number) override {
    for (const int l : sent_[number].brings) in_flight_.erase(l);
    if (keeps_refused) not_taken.push_back(std::move(sent_[number].group));
    sent_.erase(number);
    ++refusals;
  }
  void reset() override {
    taken.clear(), taken_factors.clear();
    for (auto& l : landmarks) l.reset();
    for (auto& [number, sent] : sent_)
      for (Measured& m : sent.group)
        m.stale = sees(m) && std::find(sent.brings.begin(), sent.brings.end(), m.landmark) == sent.brings.end();
  }
  std::size_t waiting() const { return sent_.size(); }

 private:
  struct Sent {
    MeasuredGroup group;
    std::vector<int> brings;  // landmarks, in the order of its variables
  };
  static bool sees(const Measured& m) { return m.kind == Measured::Kind::sight || m.kind == Measured::Kind::landmark; }
  bool waits(const MeasuredGroup& group) const {  // for a landmark that another group brings
    for (const Measured& m : group)
      if (sees(m) && in_flight_.count(m.landmark) > 0) return true;
    return false;
  }
  void send(MeasuredGroup group, PendingFactors& pending) {
    Sent sent;
    std::map<int, VariableId<Point2d>> ids;
    const std::uint64_t number = pending.begin(pending.sensor(sensors[group[0].sensor]));
    for (const Measured& m : group) {
      if (!sees(m) || ids.count(m.landmark) > 0) continue;
      if (static_cast<std::size_t>(m.landmark) >= landmarks.size()) landmarks.resize(m.landmark + 1);
      if (landmarks[m.landmark]) {
        ids[m.landmark] = *landmarks[m.landmark];
      } else {
        ids[m.landmark] = pending.add(Point2d{});
        sent.brings.push_back(m.landmark);
        in_flight_.insert(m.landmark);
      }
    }
    for (const Measured& m : group) add(m, ids, pending);
    pending.end();
    sent.group = std::move(group);
    sent_[number] = std::move(sent);
  }
  void add(const Measured& m, std::map<int, VariableId<Point2d>>& ids, PendingFactors& pending) const {
    const Vec2d z2{{m.z[0], m.bad ? std::nan("") : m.z[1]}};
    const At<Position> x{positions, m.a};
    const auto noise = Sigma(m.sigma);
    switch (m.kind) {
      case Measured::Kind::position:
        return pending.add(Prior{Position{z2}}, noise, x);
      case Measured::Kind::step:
        return pending.add(Between{Position{z2}}, noise, x, At<Position>{positions, m.b});
      case Measured::Kind::sight:
        return pending.add(Sight{z2}, noise, x, ids[m.landmark]);
      case Measured::Kind::landmark:
        return pending.add(Prior{Point2d{z2}}, noise, ids[m.landmark]);
      case Measured::Kind::level:
        return pending.add(Prior{Level{{{m.z[0], m.z[1], m.z[2]}}}}, noise, At<Level>{levels, m.a});
      case Measured::Kind::offset:
        return pending.add(Prior{Offset{{{m.z[0]}}}}, noise, At<Offset>{levels, m.a});
      case Measured::Kind::tie:
        return pending.add(Tie{m.z[0]}, noise, x, At<Offset>{levels, m.b});
    }
  }

  std::unordered_map<std::uint64_t, Sent> sent_;
  std::set<int> in_flight_;
};

struct LinearWindow {
  SlidingWindow window;
  LinearBuilder* builder = nullptr;
  PositionProvider* position = nullptr;
  LevelProvider* level = nullptr;
  LagPolicy* policy = nullptr;
  ProviderId positions, levels;
  Increments<2> all_moved;  // of the providers, since the beginning
  Increments<4> all_levelled;
  std::mt19937 random;

  explicit LinearWindow(int most_states = 5, unsigned seed = 1, const WindowOptions& options = exact())
      : window(options), random(seed) {
    auto b = std::make_unique<LinearBuilder>();
    auto p = std::make_unique<PositionProvider>();
    auto l = std::make_unique<LevelProvider>();
    auto lag = std::make_unique<LagPolicy>();
    builder = b.get(), position = p.get(), level = l.get(), policy = lag.get();
    EXPECT_TRUE(policy->set({1, most_states, {}}).ok());
    window.set(std::move(lag));
    positions = builder->positions = window.add(std::move(p));
    levels = builder->levels = window.add(std::move(l));
    window.add(std::move(b));
    position->moved.begin(at_ms(0)), all_moved.begin(at_ms(0));
    level->moved.begin(at_ms(0)), all_levelled.begin(at_ms(0));
  }
  // A linear problem is solved by one step that is hardly damped, and polished by another.
  static WindowOptions exact() {
    WindowOptions options;
    options.solve.initial_lambda = 1e-16;  // a step that is short by more would be too small to lower the cost again
    options.solve.function_tolerance = 0.0;
    options.solve.max_iterations = 4;
    options.marginalize.landmarks = LandmarkPolicy::keep;
    return options;
  }

  double uniform(double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); }
  int any(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); }
  // The providers hear how it moved until then.
  void move_to(std::int64_t ms) {
    const Vec2d step{{uniform(-1, 1), uniform(-1, 1)}};
    const Vec4d levelled{{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)}};
    position->moved.add(at_ms(ms), step), all_moved.add(at_ms(ms), step);
    level->moved.add(at_ms(ms), levelled), all_levelled.add(at_ms(ms), levelled);
  }
  Measured measured(Measured::Kind kind, std::int64_t a_ms, std::int64_t b_ms = 0, int landmark = 0) {
    Measured m{kind, at_ms(a_ms), at_ms(b_ms), landmark, {}, 0.0, false, 0, false};
    for (double& z : m.z) z = uniform(-5, 5);
    m.sigma = uniform(0.05, 0.5);
    return m;
  }
  Measured position_at(std::int64_t ms) { return measured(Measured::Kind::position, ms); }
  Measured step(std::int64_t a, std::int64_t b) { return measured(Measured::Kind::step, a, b); }
  Measured sight(std::int64_t ms, int landmark) { return measured(Measured::Kind::sight, ms, 0, landmark); }
  Measured level_at(std::int64_t ms) { return measured(Measured::Kind::level, ms); }
  Measured offset_at(std::int64_t ms) { return measured(Measured::Kind::offset, ms); }
  Measured tie(std::int64_t a, std::int64_t b) { return measured(Measured::Kind::tie, a, b); }
  void give(MeasuredGroup group) { builder->queue.push_back(std::move(group)); }

  // Of all that the window has taken.
  DenseTruth truth() const {
    DenseTruth truth;
    std::set<Time> at_position, at_level;
    for (const MeasuredGroup& group : builder->taken)
      for (const Measured& m : group) add(truth, m, at_position, at_level);
    link(truth, at_position, all_moved, [&](Time a, Time b, const auto& z, double sigma) {
      truth.add({{{What::position, b.ns}}, {{What::position, a.ns}, -1.0}}, Eigen::Vector2d(z[0], z[1]), sigma);
    });
    link(truth, at_level, all_levelled, [&](Time a, Time b, const auto& z, double sigma) {
      truth.add({{{What::level, b.ns}}, {{What::level, a.ns}, -1.0}}, Eigen::Vector3d(z[0], z[1], z[2]), sigma);
      truth.add({{{What::offset, b.ns}}, {{What::offset, a.ns}, -1.0}}, Eigen::VectorXd::Constant(1, z[3]), sigma);
    });
    if (!at_position.empty())
      truth.add({{{What::position, at_position.begin()->ns}}}, Eigen::Vector2d::Zero(), kFirstSigma);
    if (!at_level.empty()) {
      truth.add({{{What::level, at_level.begin()->ns}}}, Eigen::Vector3d::Zero(), kFirstSigma);
      truth.add({{{What::offset, at_level.begin()->ns}}}, Eigen::VectorXd::Zero(1), kFirstSigma);
    }
    return truth;
  }
  // The largest difference between a value of the window and the truth, over all states and landmarks in it.
  double error() const {
    const auto truth = this->truth().solve();
    double worst = 0.0;
    auto compare = [&](const Unknown& u, const double* value) {
      const auto at = truth.find(u);
      EXPECT_NE(at, truth.end()) << "a state that nothing was taken for";
      for (int i = 0; at != truth.end() && i < u.dim(); ++i)
        worst = std::max(worst, std::fabs(value[i] - at->second[i]));
    };
    const Graph& graph = window.graph();
    for (const State& s : window.states().timeline(positions))
      compare({What::position, s.time.ns}, graph.value(VariableId<Position>{s.variables[0].key}).v.data());
    for (const State& s : window.states().timeline(levels)) {
      compare({What::level, s.time.ns}, graph.value(LevelProvider::level(s)).v.data());
      compare({What::offset, s.time.ns}, graph.value(LevelProvider::offset(s)).v.data());
    }
    for (std::size_t l = 0; l < builder->landmarks.size(); ++l)
      if (builder->landmarks[l] && graph.contains(*builder->landmarks[l]))
        compare({What::landmark, static_cast<std::int64_t>(l)}, graph.value(*builder->landmarks[l]).p.data());
    return worst;
  }

 private:
  template <class Link, int D>
  static void link(DenseTruth&, const std::set<Time>& times, const Increments<D>& moved, Link&& add_link) {
    for (auto b = times.begin(); b != times.end(); ++b)
      if (b != times.begin()) {
        const Time a = *std::prev(b);
        add_link(a, *b, moved.between(a, *b), moved.sigma(a, *b));
      }
  }
  static void add(DenseTruth& truth, const Measured& m, std::set<Time>& at_position, std::set<Time>& at_level) {
    const Eigen::Vector2d z(m.z[0], m.z[1]);
    const Unknown x{What::position, m.a.ns}, l{What::landmark, m.landmark};
    using Kind = Measured::Kind;
    if (m.kind == Kind::position || m.kind == Kind::step || m.kind == Kind::sight || m.kind == Kind::tie)
      at_position.insert(m.a);
    if (m.kind == Kind::step) at_position.insert(m.b);
    if (m.kind == Kind::level || m.kind == Kind::offset) at_level.insert(m.a);
    if (m.kind == Kind::tie) at_level.insert(m.b);
    switch (m.kind) {
      case Kind::position:
        return truth.add({{x}}, z, m.sigma);
      case Kind::step:
        return truth.add({{{What::position, m.b.ns}}, {x, -1.0}}, z, m.sigma);
      case Kind::sight:
        return truth.add({{l}, {x, -1.0}}, z, m.sigma);
      case Kind::landmark:
        return truth.add({{l}}, z, m.sigma);
      case Kind::level:
        return truth.add({{{What::level, m.a.ns}}}, Eigen::Vector3d(m.z[0], m.z[1], m.z[2]), m.sigma);
      case Kind::offset:
        return truth.add({{{What::offset, m.a.ns}}}, Eigen::VectorXd::Constant(1, m.z[0]), m.sigma);
      case Kind::tie:
        return truth.add({{x, 1.0, 0}, {{What::offset, m.b.ns}, -1.0}}, Eigen::VectorXd::Constant(1, m.z[0]), m.sigma);
    }
  }
};

}  // namespace oriel::linear_world
