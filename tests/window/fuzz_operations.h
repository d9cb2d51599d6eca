// The operations of the window's fuzz: what is done to the window, at random, and to its model.
#pragma once
#include "oriel/window/late_fusion.h"
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
  std::vector<State> states_chosen;  // one may have come in the same update
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
    states_chosen.clear();
    for (const LeavingState& l : leaving) {
      const State* s = states.timeline(l.provider).find(l.time);  // a rejected group may have taken the state along
      states_chosen.push_back(s != nullptr ? *s : State{});
    }
  }
};

// What a run is like, by its seed.
struct FuzzPlan {
  WindowOptions options = LinearWindow::exact();
  bool late = false;   // late groups are folded
  bool batch = false;  // nothing is lost, so that at the end the window is the batch of all that came
  LateLedgerOptions ledger;
  Duration memory{0};  // of the providers

  explicit FuzzPlan(unsigned seed) {
    std::mt19937 random(seed);
    const auto any = [&](unsigned n) { return static_cast<int>(random() % n); };
    options.slide_before_solve = any(2) == 0;
    late = any(3) > 0;
    batch = any(4) == 0;
    constexpr LandmarkPolicy kPolicies[] = {LandmarkPolicy::keep, LandmarkPolicy::close, LandmarkPolicy::drop};
    options.marginalize.landmarks = kPolicies[any(batch ? 2 : 3)];
    ledger.conditionals = any(4) == 0 ? 8 : 500;
    ledger.horizon = Duration{std::int64_t{1000000} * (any(3) == 0 ? 0 : 150 + any(2000))};
    memory = Duration{std::int64_t{1000000} * any(3000)};
  }
};

class FuzzOperations {
 public:
  struct Counts {
    std::int64_t updates = 0, entered = 0, refused = 0, failed_solves = 0, failed_slides = 0, marginalized = 0,
                 removed = 0, resets = 0, waited = 0, late = 0, late_states = 0, absorbed = 0, closed = 0, dropped = 0,
                 asked = 0, batches = 0;
    void add(const Counts& c) {
      updates += c.updates, entered += c.entered, refused += c.refused, failed_solves += c.failed_solves;
      failed_slides += c.failed_slides, marginalized += c.marginalized, removed += c.removed, resets += c.resets;
      waited += c.waited, late += c.late, late_states += c.late_states, absorbed += c.absorbed, closed += c.closed;
      dropped += c.dropped, asked += c.asked, batches += c.batches;
    }
  };

 protected:
  explicit FuzzOperations(unsigned seed) : plan_(seed), w_(4, seed, plan_.options) {
    w_.builder->keeps_refused = true;
    w_.builder->sensors = {"linear", "doomed", "gap"};
    for (const char* name : w_.builder->sensors) w_.window.pending().sensor(name);
    w_.window.add(std::make_unique<FuzzHook>());
    auto policy = std::make_unique<FuzzPolicy>();
    policy_ = policy.get();
    w_.window.set(std::move(policy));
    model_.moved.begin(at_ms(0)), model_.levelled.begin(at_ms(0));
    model_.remembers = plan_.late;
    if (!plan_.late) return;
    auto late = std::make_unique<LateFusion>(plan_.ledger);
    late_ = late.get();
    w_.window.set(std::move(late));
    w_.window.remember(plan_.memory);
  }
  bool wrong(const std::string& what) {
    if (difference_.empty()) difference_ = what;
    return false;
  }

  // ---- operations ----
  void operate() {
    const int what = w_.any(100);
    if (what < 68) return measure();
    if (what < 86) return move();
    if (what < 88) return absorb_a_factor();
    if (what < 89) return marginalize_a_landmark();
    if (what < 90) return set_lag();
    if (plan_.batch) return measure();
    if (what < 92) return remove_a_factor();
    if (what < 94) return remove_a_landmark();
    if (what < 96) return add_a_factor();
    if (what < 98) return take_from_the_middle();
    (w_.any(2) == 0 ? w_.position->faults.link_fails_in : w_.position->faults.link_nan_in) = w_.any(3);
    faulty_ = true;
  }
  std::int64_t some_time() {
    const int kind = w_.any(20);
    if (plan_.late && w_.any(8) == 0) return std::max<std::int64_t>(now_ - w_.any(2500), 0) / 5 * 5;
    std::int64_t t = kind < 10 ? now_ : kind < 17 ? now_ - w_.any(200) : kind < 19 ? now_ + w_.any(60) : now_ - 1000;
    if (w_.any(3) > 0) t = t / 20 * 20;  // many share a stamp
    return std::max<std::int64_t>(t, 0);
  }
  // One of those that are being seen. What has left is seen anew under another number, as a rule.
  int some_landmark() {
    const int slot = static_cast<int>(now_ / 150) + w_.any(2);
    const auto [at, is_new] = numbers_.emplace(slot, next_number_);
    const auto& ids = w_.builder->landmarks;
    const auto l = static_cast<std::size_t>(at->second);
    const bool has_left = !is_new && l < ids.size() && ids[l] && !w_.window.graph().contains(*ids[l]);
    if (has_left && w_.any(10) > 0) at->second = next_number_;
    next_number_ += at->second == next_number_;
    return at->second;
  }
  void measure() {
    MeasuredGroup group;
    const std::int64_t t = some_time();
    for (int n = 1 + w_.any(3); n > 0; --n) {
      const int kind = w_.any(10);
      const int landmark = some_landmark();
      if (kind < 3) group.push_back(w_.position_at(t));
      if (kind == 3) group.push_back(w_.step(std::max<std::int64_t>(0, t - 20 - w_.any(60)), t + 1));
      if (kind > 3 && kind < 7) group.push_back(w_.sight(t, landmark));
      if (kind == 7) group.push_back(w_.level_at(t));
      if (kind == 8) group.push_back(w_.tie(t, some_time()));
      if (kind == 9) group.push_back(w_.measured(Measured::Kind::landmark, 0, 0, landmark));
    }
    const int luck = w_.any(200);
    if (luck < 20) group[0].sensor = kDoomed;
    if (luck == 20 && !plan_.batch) group[0].sensor = kGap;
    if (luck > 190 && group[0].kind != Measured::Kind::level && group[0].kind != Measured::Kind::tie)
      group[0].bad = true;
    if (luck == 30 && !plan_.batch) {  // each is a number, and their sum is none
      Measured monster = w_.position_at(now_);
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
    if (is_faint({What::landmark, l})) return;
    w_.window.core().edit().remove(*w_.builder->landmarks[l]);
    if (!w_.window.core().commit().ok()) return void(wrong("a landmark could not be removed"));
    model_.remove({What::landmark, l});
  }
  // The library's prior of which a factor becomes a part, if only one can be meant, and the model's that is the same.
  struct Host {
    bool clear = true;
    std::optional<std::size_t> prior;
  };
  Host host_of(const std::set<Unknown>& of) const {
    const std::vector<ModelPrior> theirs = priors_of(w_, model_.landmarks);
    std::size_t most = 0, hosts = 0;
    std::set<Unknown> host;
    for (const ModelPrior& p : theirs) {
      const std::set<Unknown> names(p.of.begin(), p.of.end());
      if (!std::includes(names.begin(), names.end(), of.begin(), of.end()) || names.size() < most) continue;
      hosts = names.size() > most ? 1 : hosts + 1;
      most = names.size(), host = names;
    }
    Host found{hosts <= 1, {}};
    for (std::size_t k = 0; k < model_.priors().size(); ++k) {
      const ModelPrior& p = model_.priors()[k];
      const std::set<Unknown> names(p.of.begin(), p.of.end());
      const bool same = hosts == 1 && names == host;
      if (same && found.prior) found.clear = false;
      if (same) found.prior = k;
    }
    found.clear = found.clear && found.prior.has_value() == (hosts == 1);
    return found;
  }
  // A measurement or a motion, by the user (M10).
  void absorb_a_factor() {
    std::set<Unknown> of;
    FactorId id;
    const int chain = w_.any(3);
    Time at;
    if (chain < 2) {
      const auto& line = w_.window.states().timeline({chain});
      if (line.size() < 2) return;
      const std::size_t k = 1 + static_cast<std::size_t>(w_.any(static_cast<int>(line.size()) - 1));
      if (!line[k].has_motion() || !w_.window.graph().contains(line[k].motion)) return;
      id = line[k].motion, at = line[k].time;
      for (const Time t : {line[k - 1].time, line[k].time})
        for (const Unknown& u : WindowModel::unknowns(chain, t)) of.insert(u);
    } else {
      std::vector<const ModelRow*> all;
      for (const ModelRow& r : model_.rows())
        if (r.factor.table != 0) all.push_back(&r);
      if (all.empty()) return;
      const ModelRow& row = *all[w_.any(static_cast<int>(all.size()))];
      id = row.factor;
      for (const auto& t : row.terms) of.insert(t.of);
    }
    const Host host = host_of(of);
    if (!host.clear) return;
    WindowCore& core = w_.window.core();
    const auto report = marginalizer_.absorb(core.followed(), {&id, 1}, plan_.options.marginalize, core.edit());
    if (!report || !core.commit().ok()) return void(wrong("a factor could not be absorbed"));
    if (report->absorbed_factors != 1) wrong("another number of factors was absorbed");
    if (chain < 2)
      model_.absorb_motion(chain, at, host.prior);
    else
      model_.absorb(id, host.prior);
    ++counts_.absorbed;
  }
  // One variable, by the user (M10).
  void marginalize_a_landmark() {
    if (model_.landmarks.empty()) return;
    auto at = model_.landmarks.begin();
    std::advance(at, w_.any(static_cast<int>(model_.landmarks.size())));
    const int l = *at;
    const VariableKey id = *w_.builder->landmarks[l];
    if (!w_.window.core().slide({&id, 1}, plan_.options.marginalize))
      return void(wrong("a landmark could not be marginalized"));
    model_.marginalize_landmark(l);
    ++counts_.asked;
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
    for (const Unknown& u : WindowModel::unknowns(chain, s.time))
      if (!marginalize && is_faint(u)) return;
    using How = LeavingState::How;
    policy_->extra = LeavingState{{chain}, s.time, marginalize ? How::marginalize : How::remove};
  }
  bool is_faint(const Unknown& u) {
    model_.theirs = priors_of(w_, model_.landmarks);
    return model_.is_faint(u);
  }
  void set_lag() {
    const int least = 1 + w_.any(3);
    const Lag lag{least, least + 2 + w_.any(5), Duration{w_.any(3) == 0 ? 150000000 : 0}};
    if (!policy_->lag.set(lag).ok()) wrong("a lag that can be kept was refused");
  }

  FuzzPlan plan_;
  LinearWindow w_;
  WindowModel model_;
  FuzzPolicy* policy_ = nullptr;
  LateFusion* late_ = nullptr;
  Marginalizer marginalizer_;
  std::map<int, int> numbers_;  // of landmarks, by the place where they are seen
  int next_number_ = 0;
  std::int64_t now_ = 0;
  bool faulty_ = false;
  std::string difference_;
  Counts counts_;
};

}  // namespace oriel::linear_world
