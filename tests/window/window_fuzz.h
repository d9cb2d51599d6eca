// Model-based fuzz of the sliding window: random operations go to the window and to a dense model of it, and after each
// update both must have the same states and landmarks, at the same values; and every refusal must have a reason that
// the model knows.
#pragma once
#include <functional>

#include "window_reader.h"

namespace oriel::linear_world {

enum FuzzSensor { kGood, kDoomed, kGap };  // groups of the second are rejected, one of the third begins the window anew

struct FuzzHook final : InsertionHook {
  std::string_view name() const override { return "fuzz"; }
  Verdict inserted(const Graph&, const States&, const InsertedGroup& in, GraphEdit&) override {
    if (in.sensor == kDoomed) return {true, false, "doomed"};
    return {false, in.sensor == kGap, "gap"};
  }
};

struct FuzzPolicy final : WindowPolicy {
  LagPolicy lag;
  std::optional<LeavingState> extra;
  std::vector<LeavingState> chosen;
  bool paused = false;
  void choose(const Graph& graph, const States& states, std::vector<LeavingState>& leaving) override {
    if (paused) return;
    lag.choose(graph, states, leaving);
    if (extra && std::none_of(leaving.begin(), leaving.end(), [&](const LeavingState& l) {
          return l.provider == extra->provider && l.time == extra->time;
        }))
      leaving.push_back(*extra);
    extra.reset();
    chosen = leaving;
  }
};

class WindowFuzz {
 public:
  explicit WindowFuzz(unsigned seed) : w_(4, seed, options(seed)) {
    w_.builder->keeps_refused = true;
    w_.builder->sensors = {"linear", "doomed", "gap"};
    for (const char* name : w_.builder->sensors) w_.window.pending().sensor(name);
    w_.window.add(std::make_unique<FuzzHook>());
    auto policy = std::make_unique<FuzzPolicy>();
    policy_ = policy.get();
    w_.window.set(std::move(policy));
    model_.moved.begin(at_ms(0)), model_.levelled.begin(at_ms(0));
    set_lag();
    (void)w_.window.update();
  }

  // Some operations and an update. False: they differ, and `difference` says how.
  bool step() {
    operations_ += 1 + w_.any(6);
    now_ += 5 + w_.any(60);
    for (std::int64_t k = w_.any(6); k > 0; --k) operate();
    return update();
  }
  std::int64_t operations() const { return operations_; }
  const std::string& difference() const { return difference_; }
  double worst() const { return worst_; }
  double worst_prior() const { return worst_prior_; }
  struct Counts {
    std::int64_t updates = 0, entered = 0, refused = 0, failed_solves = 0, failed_slides = 0, marginalized = 0,
                 removed = 0, resets = 0, waited = 0;
  };
  const Counts& counts() const { return counts_; }
  // What the last update said, for people.
  std::string last() const {
    const WindowUpdate& u = w_.window.last_update();
    return "entered " + std::to_string(u.entered) + ", refused " + reasons(u) + (faulty_ ? ", with a fault" : "");
  }

 private:
  static WindowOptions options(unsigned seed) {
    WindowOptions o = LinearWindow::exact();
    o.slide_before_solve = seed % 2 == 1;
    return o;
  }
  bool wrong(const std::string& what) {
    if (difference_.empty()) difference_ = what;
    return false;
  }

  // ---- operations ----
  void operate() {
    const int what = w_.any(100);
    if (what < 70) return measure();
    if (what < 88) return move();
    if (what < 91) return remove_a_factor();
    if (what < 93) return remove_a_landmark();
    if (what < 95) return add_a_factor();
    if (what < 97) return take_from_the_middle();
    if (what < 98) return set_lag();
    (w_.any(2) == 0 ? w_.position->faults.link_fails_in : w_.position->faults.link_nan_in) = w_.any(3);
    faulty_ = true;
  }
  std::int64_t some_time() {
    const int kind = w_.any(20);
    std::int64_t t = kind < 10 ? now_ : kind < 17 ? now_ - w_.any(200) : kind < 19 ? now_ + w_.any(60) : now_ - 1000;
    if (w_.any(3) > 0) t = t / 20 * 20;  // many share a stamp
    return std::max<std::int64_t>(t, 0);
  }
  void measure() {
    MeasuredGroup group;
    const std::int64_t t = some_time();
    for (int n = 1 + w_.any(3); n > 0; --n) {
      const int kind = w_.any(10);
      const int landmark = static_cast<int>(now_ / 150) + w_.any(2);
      if (kind < 3) group.push_back(w_.position_at(t));
      if (kind == 3) group.push_back(w_.step(std::max<std::int64_t>(0, t - 20 - w_.any(60)), t + 1));
      if (kind > 3 && kind < 7) group.push_back(w_.sight(t, landmark));
      if (kind == 7) group.push_back(w_.level_at(t));
      if (kind == 8) group.push_back(w_.tie(t, some_time()));
      if (kind == 9) group.push_back(w_.measured(Measured::Kind::landmark, 0, 0, landmark));
    }
    const int luck = w_.any(200);
    if (luck < 20) group[0].sensor = kDoomed;
    if (luck == 20) group[0].sensor = kGap;
    if (luck > 190 && group[0].kind != Measured::Kind::level && group[0].kind != Measured::Kind::tie)
      group[0].bad = true;
    if (luck == 30) {  // each is a number, and their sum is none
      Measured monster = w_.position_at(t);
      monster.z = {1e153, 0.0, 0.0}, monster.sigma = 0.1;
      group.assign(5, monster);
    }
    w_.give(std::move(group));
  }
  void move() {
    if (w_.any(3) > 0) {
      if (w_.position->moved.last() >= at_ms(now_)) return;
      const Vec2d step{{w_.uniform(-1, 1), w_.uniform(-1, 1)}};
      w_.position->moved.add(at_ms(now_), step), model_.moved.add(at_ms(now_), step);
    } else if (w_.level->moved.last() < at_ms(now_)) {
      const Vec4d step{{w_.uniform(-1, 1), w_.uniform(-1, 1), w_.uniform(-1, 1), w_.uniform(-1, 1)}};
      w_.level->moved.add(at_ms(now_), step), model_.levelled.add(at_ms(now_), step);
    }
  }
  void remove_a_factor() {
    std::vector<FactorId> all;
    for (const auto& r : model_.rows())
      if (r.factor.table != 0) all.push_back(r.factor);
    if (all.empty()) return;
    const FactorId id = all[w_.any(static_cast<int>(all.size()))];
    w_.window.core().edit().remove(id);
    if (!w_.window.core().commit().ok()) return void(wrong("a factor could not be removed"));
    model_.remove_factor(id);
  }
  void remove_a_landmark() {
    if (model_.landmarks.empty()) return;
    auto at = model_.landmarks.begin();
    std::advance(at, w_.any(static_cast<int>(model_.landmarks.size())));
    const int l = *at;
    w_.window.core().edit().remove(*w_.builder->landmarks[l]);
    if (!w_.window.core().commit().ok()) return void(wrong("a landmark could not be removed"));
    model_.remove({What::landmark, l});
  }
  // The user's own, between states that are there.
  void add_a_factor() {
    const auto& line = w_.window.states().timeline(w_.positions);
    if (line.size() < 2) return;
    const State &a = line[w_.any(static_cast<int>(line.size()))], &b = line[w_.any(static_cast<int>(line.size()))];
    if (a.time == b.time) return;
    const Measured m{
        Measured::Kind::step, a.time, b.time, 0, {w_.uniform(-5, 5), w_.uniform(-5, 5), 0}, 0.3, false, 0, false};
    WindowModel::Row row = WindowModel::row_of(m);
    row.factor =
        w_.window.core().edit().add(Between{Position{{{m.z[0], m.z[1]}}}}, Sigma(m.sigma),
                                    VariableId<Position>{a.variables[0].key}, VariableId<Position>{b.variables[0].key});
    if (!w_.window.core().commit().ok()) return void(wrong("a factor could not be added"));
    model_.add_row(std::move(row));
  }
  // A state that is not the oldest, and whose motion is a factor: else nothing might be known of what is left.
  void take_from_the_middle() {
    const int chain = w_.any(2);
    const auto& line = w_.window.states().timeline({chain});
    if (line.size() < 3) return;
    const State& s = line[1 + w_.any(static_cast<int>(line.size()) - 1)];
    if (!s.has_motion()) return;
    const bool marginalize = w_.any(2) == 0;
    if (!marginalize && &s == line.latest()) return;
    using How = LeavingState::How;
    policy_->extra = LeavingState{{chain}, s.time, marginalize ? How::marginalize : How::remove};
  }
  void set_lag() {
    const int least = 1 + w_.any(3);
    const Lag lag{least, least + 2 + w_.any(5), Duration{w_.any(3) == 0 ? 150000000 : 0}};
    if (!policy_->lag.set(lag).ok()) wrong("a lag that can be kept was refused");
  }

  // ---- an update, and what it did ----
  bool update() {
    before_ = values_of(w_, model_.landmarks);
    ids_before_ = w_.builder->landmarks;
    for (int c = 0; c < 2; ++c)
      chains_before_[c] = model_.chains[c], horizons_before_[c] = w_.window.states().horizon({c});
    policy_->chosen.clear();
    policy_->paused = faulty_;
    const WindowUpdate& update = w_.window.update();
    count(update);
    if (!difference_.empty()) return false;
    if (update.reset[0] != '\0') model_.begin_anew();
    check_refusals(update);
    follow_faulty_states();
    for (std::size_t k = 0; k < w_.builder->taken.size(); ++k) enter(k);
    w_.builder->taken.clear(), w_.builder->taken_factors.clear();
    if (update.status == WindowUpdate::Status::slide_failed && !faulty_)
      wrong("a slide failed: " + update.error.message);
    const bool before = w_.window.options().slide_before_solve;
    if (before) leave();
    WindowModel::Values truth;
    const bool solved =
        update.status == WindowUpdate::Status::updated || update.status == WindowUpdate::Status::slide_failed;
    if (solved) truth = model_.solve();
    if (!before) leave();
    for (const FactorId id : update.expelled) model_.remove_factor(id);
    if (!model_.wrong.empty()) wrong(model_.wrong);
    compare_sets();
    compare_priors();
    if (solved) compare(truth);
    const bool same_window = update.reset[0] == '\0';
    if (same_window && update.status == WindowUpdate::Status::solve_failed) compare_unchanged();
    w_.position->faults = {}, faulty_ = false;
    return difference_.empty() && !over_;
  }
  void count(const WindowUpdate& u) {
    ++counts_.updates;
    counts_.entered += u.entered, counts_.refused += u.refused, counts_.waited += u.waiting;
    counts_.marginalized += u.states_marginalized, counts_.removed += u.states_removed;
    counts_.resets += u.reset[0] != '\0';
    counts_.failed_solves += u.status == WindowUpdate::Status::solve_failed;
    counts_.failed_slides += u.status == WindowUpdate::Status::slide_failed;
  }
  void enter(std::size_t k) {
    const MeasuredGroup& group = w_.builder->taken[k];
    if (group[0].sensor == kDoomed) wrong("a group that a hook rejects has entered");
    model_.enter(group, w_.builder->taken_factors[k]);
  }
  // A motion that fails may keep a rejected group's state from being taken out again. A first state is older than all
  // that come after it.
  void follow_faulty_states() {
    for (int c = 0; c < 2 && faulty_; ++c)
      for (const State& s : w_.window.states().timeline({c})) model_.add_state(c, s.time);
  }
  void check_refusals(const WindowUpdate& update) {
    std::int64_t told = 0;
    for (const Refusals& r : update.refusals) told += r.total();
    if (told != update.refused) wrong("refusals by sensor do not add up");
    for (const MeasuredGroup& group : w_.builder->not_taken)
      if (!has_reason(group)) wrong("a group was refused without a reason: " + text(group) + "; " + reasons(update));
    w_.builder->not_taken.clear();
  }
  static std::string text(const MeasuredGroup& group) {
    std::string all;
    for (const Measured& m : group)
      all += " kind " + std::to_string(static_cast<int>(m.kind)) + " at " + std::to_string(m.a.ns / 1000000) + ", " +
             std::to_string(m.b.ns / 1000000) + " [ms], landmark " + std::to_string(m.landmark) + ";";
    return all;
  }
  static std::string reasons(const WindowUpdate& update) {
    std::string all;
    for (const Refusals& r : update.refusals)
      for (std::size_t k = 0; k < r.counts.size(); ++k)
        if (r.counts[k] > 0) all += std::string(kRefusalNames[k]) + " " + std::to_string(r.counts[k]) + " ";
    return all + update.error.message + update.reset;
  }
  bool has_reason(const MeasuredGroup& group) const {
    if (faulty_ || group[0].sensor == kDoomed || group[0].bad) return true;
    for (const Measured& m : group) {
      if (m.stale) return true;
      const auto& ids = ids_before_;
      if (WindowModel::names_landmark(m) && static_cast<std::size_t>(m.landmark) < ids.size() && ids[m.landmark] &&
          !w_.window.graph().contains(*ids[m.landmark]))
        return true;
      for (const auto& [chain, time] : WindowModel::times(m))
        if (w_.window.states().reach({chain}, time) == Reach::too_old || severed_at(model_.chains[chain], time) ||
            was_too_old(chain, time))
          return true;
    }
    return false;
  }
  static bool severed_at(const WindowModel::Chain& line, Time time) {
    const auto after = line.lower_bound(time);
    return after != line.end() && after->first != time && after->second.severed;
  }
  // For the window before the update: one that begins anew in it may reach back further, to the end of the chain that
  // lags most.
  bool was_too_old(int chain, Time time) const {
    return time < horizons_before_[chain] || severed_at(chains_before_[chain], time);
  }
  void leave() {
    std::vector<std::pair<int, Time>> marginalized;
    for (const LeavingState& l : policy_->chosen) {
      const bool gone = w_.window.states().timeline(l.provider).find(l.time) == nullptr;
      const bool known = model_.chains[l.provider.index].count(l.time) > 0;
      if (!gone || !known) continue;
      if (l.how == LeavingState::How::marginalize) {
        marginalized.emplace_back(l.provider.index, l.time);
        continue;
      }
      drop_landmarks_of(l);
      model_.remove_state(l.provider.index, l.time);
    }
    std::vector<int> landmarks;
    for (const int l : model_.landmarks)
      if (!w_.window.graph().contains(*w_.builder->landmarks[l])) landmarks.push_back(l);
    if (marginalized.empty() && !landmarks.empty()) wrong("a landmark has left, and no state");
    if (!marginalized.empty()) model_.marginalize(marginalized, landmarks);
  }
  void drop_landmarks_of(const LeavingState& l) {
    if (l.provider.index != 0) return;
    const std::set<int> all = model_.landmarks;
    for (const int landmark : all)
      if (!w_.window.graph().contains(*w_.builder->landmarks[landmark]) &&
          model_.sees_alone(landmark, {What::position, l.time.ns}))
        model_.remove({What::landmark, landmark});
  }
  void compare_sets() {
    for (int c = 0; c < 2; ++c) {
      const auto& line = w_.window.states().timeline({c});
      if (line.size() != model_.chains[c].size()) return void(wrong("another number of states"));
      for (const State& s : line)
        if (model_.chains[c].count(s.time) == 0) return void(wrong("a state that should not be there"));
    }
    if (w_.window.graph().count<Point2d>() != model_.landmarks.size()) wrong("another number of landmarks");
    std::size_t factors = 0;
    for (const auto& table : w_.window.graph().tables()) factors += table->slots().size();
    std::size_t rows = model_.rows().size();
    for (const auto& chain : model_.chains)
      for (auto at = chain.begin(); at != chain.end(); ++at) rows += at != chain.begin() && !at->second.severed;
    if (factors != rows) wrong("another number of factors");
  }
  // A slide before the solve may put the absurd measurement of a solved state into the prior. All rounding is beside
  // that from then on: there is nothing left to compare, and the run ends.
  void compare(const WindowModel::Values& truth) {
    for (const auto& [u, value] : truth) over_ = over_ || value.cwiseAbs().maxCoeff() > 1e100;
    if (over_) return;
    for (const auto& [u, value] : values_of(w_, model_.landmarks)) {
      if (!value.allFinite()) wrong("a value is no number");  // L6
      const auto at = truth.find(u);
      if (at == truth.end()) continue;  // something that nothing determines any more
      const double error = (value - at->second).cwiseAbs().maxCoeff() / (1.0 + at->second.cwiseAbs().maxCoeff());
      worst_ = std::max(worst_, error);
      if (!(error < 1e-9)) wrong("a value is off by " + std::to_string(error * 1e9) + "e-9");
    }
  }
  void compare_priors() {
    if (!difference_.empty()) return;
    const double error = WindowModel::difference(priors_of(w_, model_.landmarks), model_.priors());
    worst_prior_ = std::max(worst_prior_, error);
    if (!(error < 1e-9)) wrong("the priors say another thing, by " + std::to_string(error * 1e9) + "e-9");
  }
  // W15
  void compare_unchanged() {
    for (const auto& [u, value] : values_of(w_, model_.landmarks)) {
      const auto at = before_.find(u);
      if (at != before_.end() && at->second != value) wrong("a solve that failed has moved a value");
    }
  }

  LinearWindow w_;
  WindowModel model_;
  FuzzPolicy* policy_ = nullptr;
  std::int64_t now_ = 0, operations_ = 0;
  bool faulty_ = false, over_ = false;
  std::string difference_;
  double worst_ = 0.0, worst_prior_ = 0.0;
  Counts counts_;
  WindowModel::Values before_;
  std::vector<std::optional<VariableId<Point2d>>> ids_before_;
  WindowModel::Chain chains_before_[2];
  Time horizons_before_[2];
};

}  // namespace oriel::linear_world
