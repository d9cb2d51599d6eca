// Model-based fuzz of the sliding window: random operations go to the window and to a dense model of it, and after each
// update both must have the same states and landmarks, at the same values; and every refusal must have a reason that
// the model knows.
#pragma once
#include "fuzz_operations.h"

namespace oriel::linear_world {

class WindowFuzz : FuzzOperations {
 public:
  using FuzzOperations::Counts;

  explicit WindowFuzz(unsigned seed) : FuzzOperations(seed) {
    model_.ledger.renamed = [this](const Unknown& u, const Unknown& now) {
      if (keys_.count(u) > 0) keys_[now] = keys_[u];
    };
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
  // The batch of all that was ever taken costs more than a window; such runs are short.
  bool is_over() const { return operations_ >= (plan_.batch ? 250 : 2000); }
  void finish() {
    if (!plan_.batch || over_ || !difference_.empty()) return;
    w_.builder->taken = std::move(accepted_);
    w_.all_moved = model_.moved, w_.all_levelled = model_.levelled;
    const double error = w_.error();
    worst_ = std::max(worst_, error);
    ++counts_.batches;
    if (!(error < 1e-9))
      wrong("the window is not the batch of all that came, by " + std::to_string(error * 1e9) + "e-9");
  }
  std::int64_t operations() const { return operations_; }
  const std::string& difference() const { return difference_; }
  double worst() const { return worst_; }
  double worst_prior() const { return worst_prior_; }
  const Counts& counts() const { return counts_; }
  // What the last update said, for people.
  std::string last() const {
    const WindowUpdate& u = w_.window.last_update();
    return "entered " + std::to_string(u.entered) + ", refused " + reasons(u) + (faulty_ ? ", with a fault" : "");
  }

 private:
  // ---- an update, and what it did ----
  bool update() {
    remember_before();
    const WindowUpdate& update = w_.window.update();
    count(update);
    if (!difference_.empty()) return false;
    doubtful_ = without_reason(std::move(w_.builder->not_taken));
    w_.builder->not_taken.clear();
    if (update.reset[0] != '\0') {
      model_.begin_anew();
      std::fill_n(model_.horizons, 2, States::kNever);  // what came after that came to a new window
    }
    follow_faulty_states();
    for (std::size_t k = 0; k < w_.builder->taken.size(); ++k) enter(k);
    w_.builder->taken.clear(), w_.builder->taken_factors.clear();
    check_refusals(update);
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
  void learn_keys(int chain, const State& s) {
    const auto unknowns = WindowModel::unknowns(chain, s.time);
    for (std::size_t k = 0; k < unknowns.size(); ++k) keys_[unknowns[k]] = s.variables[k];
  }
  void remember_before() {
    before_ = values_of(w_, model_.landmarks);
    ids_before_ = w_.builder->landmarks;
    for (int c = 0; c < 2; ++c) {
      model_.horizons[c] = w_.window.states().horizon({c});
      for (const State& s : w_.window.states().timeline({c})) learn_keys(c, s);
    }
    for (const int l : model_.landmarks) keys_[{What::landmark, l}] = *w_.builder->landmarks[l];
    first_motion_[0] = w_.position->moved.first(), first_motion_[1] = w_.level->moved.first();
    model_.theirs = priors_of(w_, model_.landmarks);
    policy_->chosen.clear(), policy_->states_chosen.clear();
    policy_->paused = faulty_;
  }
  void count(const WindowUpdate& u) {
    ++counts_.updates;
    counts_.entered += u.entered, counts_.refused += u.refused, counts_.waited += u.waiting;
    counts_.marginalized += u.states_marginalized, counts_.removed += u.states_removed;
    counts_.resets += u.reset[0] != '\0';
    counts_.failed_solves += u.status == WindowUpdate::Status::solve_failed;
    counts_.failed_slides += u.status == WindowUpdate::Status::slide_failed;
    counts_.late += u.late;
  }
  void enter(std::size_t k) {
    const MeasuredGroup& group = w_.builder->taken[k];
    const bool late = is_late(group);
    if (group[0].sensor == kDoomed && !late) wrong("a group that a hook rejects has entered");
    if (late && late_ == nullptr) return void(wrong("a late group was taken, and none is"));
    model_.enter(group, w_.builder->taken_factors[k]);
    if (plan_.batch) accepted_.push_back(group);
    if (late) counts_.late_states += static_cast<std::int64_t>(model_.made.size()), forget();
  }
  bool is_late(const MeasuredGroup& group) const {
    for (const Measured& m : group)
      for (const auto& [chain, time] : WindowModel::times(m))
        if (model_.is_dead(chain, time)) return true;
    return false;
  }
  void forget() {
    if (late_ == nullptr) return;
    model_.forget(static_cast<std::size_t>(plan_.ledger.conditionals), plan_.ledger.horizon, [this](const Unknown& u) {
      const auto key = keys_.find(u);
      return key != keys_.end() && !late_->kept().holds(key->second);
    });
  }
  // A motion that fails may keep a rejected group's state from being taken out again. A first state is older than all
  // that come after it.
  void follow_faulty_states() {
    for (int c = 0; c < 2 && faulty_; ++c)
      for (const State& s : w_.window.states().timeline({c})) model_.add_state(c, s.time);
  }
  std::vector<MeasuredGroup> without_reason(std::vector<MeasuredGroup> groups) const {
    std::erase_if(groups, [this](const MeasuredGroup& g) { return has_reason(g); });
    return groups;
  }
  // What has no reason in the window before the update must have one in what others made of it in the update.
  void check_refusals(const WindowUpdate& update) {
    std::int64_t told = 0;
    for (const Refusals& r : update.refusals) told += r.total();
    if (told != update.refused) wrong("refusals by sensor do not add up");
    // A window that began anew has left the times behind that groups on their way in were for.
    if (update.reset[0] != '\0') doubtful_.clear();
    for (const MeasuredGroup& group : without_reason(std::move(doubtful_)))
      wrong("a group was refused without a reason: " + text(group) + "; " + reasons(update));
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
    const bool late = is_late(group);
    if (faulty_ || group[0].bad || (group[0].sensor == kDoomed && !late)) return true;
    for (const Measured& m : group) {
      if (m.stale) return true;
      const auto& ids = ids_before_;
      const bool known =
          WindowModel::names_landmark(m) && static_cast<std::size_t>(m.landmark) < ids.size() && ids[m.landmark];
      if (known && !w_.window.graph().contains(*ids[m.landmark])) return true;
      if (late && WindowModel::names_landmark(m) && !known) return true;  // it brings one
      for (const auto& [chain, time] : WindowModel::times(m))
        if (model_.is_dead(chain, time) && (late_ == nullptr || is_beyond(chain, time))) return true;
    }
    return false;
  }
  // Of a time that is not in the window any more: whether the ledger cannot have it.
  bool is_beyond(int chain, Time time) const {
    if (model_.was_there(chain, time)) return model_.is_cut(chain, time);
    const auto between = model_.neighbours(chain, time);
    if (!between || between->first < first_motion_[chain]) return true;
    return model_.is_cut(chain, between->first) || model_.is_cut(chain, between->second);
  }
  void leave() {
    for (std::size_t k = 0; k < policy_->chosen.size(); ++k)
      if (policy_->states_chosen[k].count > 0) learn_keys(policy_->chosen[k].provider.index, policy_->states_chosen[k]);
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
    if (!marginalized.empty()) marginalize(marginalized);
    for (const int l : model_.landmarks)
      if (!w_.window.graph().contains(*w_.builder->landmarks[l])) wrong("a landmark has left that should not");
  }
  void marginalize(const std::vector<std::pair<int, Time>>& states) {
    const auto landmarks = model_.marginalize(states, plan_.options.marginalize.landmarks);
    forget();
    const MarginalizeReport& said = w_.window.last_update().slide;
    if (said.leaving_landmarks != landmarks.leaving || said.kept_landmarks != landmarks.kept ||
        said.closed_landmarks != landmarks.closed || said.dropped_landmarks != landmarks.dropped ||
        said.dropped_with_landmarks != landmarks.lost_rows)
      wrong("another number of landmarks has left by policy");
    counts_.closed += landmarks.closed, counts_.dropped += landmarks.dropped;
    for (const int l : landmarks.gone)
      if (w_.window.graph().contains(*w_.builder->landmarks[l])) wrong("a landmark has not left that should");
  }
  void drop_landmarks_of(const LeavingState& l) {
    const auto unknowns = WindowModel::unknowns(l.provider.index, l.time);
    const std::set<Unknown> state(unknowns.begin(), unknowns.end());
    const std::set<int> all = model_.landmarks;
    for (const int landmark : all)
      if (!w_.window.graph().contains(*w_.builder->landmarks[landmark]) && model_.sees_alone(landmark, state))
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
    if (late_ != nullptr && late_->kept().size() != model_.ledger.size())
      wrong("another number of states is remembered: " + std::to_string(late_->kept().size()) + " for " +
            std::to_string(model_.ledger.size()));
  }
  // A slide before the solve may put the absurd measurement of a solved state into the prior. All rounding is beside
  // that from then on: there is nothing left to compare, and the run ends.
  void compare(const WindowModel::Values& truth) {
    over_ = over_ || model_.faint;
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
    if (!difference_.empty() || model_.faint) return;
    const double error = algebra::difference(priors_of(w_, model_.landmarks), model_.priors());
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

  std::int64_t operations_ = 0;
  bool over_ = false;
  double worst_ = 0.0, worst_prior_ = 0.0;
  std::vector<MeasuredGroup> accepted_, doubtful_;
  WindowModel::Values before_;
  std::vector<std::optional<VariableId<Point2d>>> ids_before_;
  std::map<Unknown, VariableKey> keys_;  // of all that was ever there
  Time first_motion_[2];                 // from there on providers know their motion
};

}  // namespace oriel::linear_world
