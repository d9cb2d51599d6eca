#include "oriel/window/sliding_window.h"

#include <algorithm>

namespace oriel {

SlidingWindow::SlidingWindow(const WindowOptions& options)
    : options_(options), policy_(std::make_unique<LagPolicy>()) {}

int SlidingWindow::add(std::unique_ptr<FactorBuilder> builder) {
  builder_sensors_.push_back(pending_.sensor(builder->name()));
  builders_.push_back(std::move(builder));
  return builder_sensors_.back();
}

int SlidingWindow::add(std::unique_ptr<BatchFactorBuilder> builder) {
  batch_sensors_.push_back(pending_.sensor(builder->name()));
  batch_builders_.push_back(std::move(builder));
  return batch_sensors_.back();
}

void SlidingWindow::set(std::unique_ptr<LateGroups> late) {
  late_ = std::move(late);
  if (late_) late_->ask([this](const GraphEdit& edit) { return pass_late_hooks(edit); });
}

Result<State> SlidingWindow::begin(ProviderId provider, Time time) {
  if (core_.has_begun()) settle();  // the state was in no solve, and what was begun counts for all that are there
  GraphEdit& edit = core_.edit();
  Result<State> state = states_.request(edit, provider, time);
  if (state)
    if (auto ok = states_.link(edit); !ok) state = ok.error();
  if (state)
    if (auto ok = core_.commit(); !ok) state = ok.error();
  if (state)
    states_.commit();
  else
    edit.clear(), states_.rollback();
  return state;
}

const WindowUpdate& SlidingWindow::update() {
  begin_report();
  merge();
  states_.follow(graph());
  drain();
  enter_ready();
  rebuild_batches();
  report_.waiting = static_cast<int>(pending_.size());
  if (graph().version() != seen_version_) {
    if (core_.defers())
      begin_solve();
    else
      solve_and_slide();
  }
  tell_updated();
  return report_;
}

const WindowUpdate& SlidingWindow::settle() {
  begin_report();
  merge();
  report_.waiting = static_cast<int>(pending_.size());
  tell_updated();
  return report_;
}

void SlidingWindow::tell_updated() {
  for (WindowListener* listener : listeners_) listener->updated(graph(), states_, report_);
}

void SlidingWindow::solve_and_slide() {
  report_.status = WindowUpdate::Status::updated;
  if (options_.slide_before_solve) slide();
  const bool solved = solve();
  if (solved && !options_.slide_before_solve) slide();
  seen_version_ = graph().version();
  if (!solved) recover();
}

void SlidingWindow::begin_solve() {
  if (report_.status == WindowUpdate::Status::nothing_new) report_.status = WindowUpdate::Status::begun;
  if (options_.slide_before_solve) slide();
  if (auto ok = core_.begin_solve(options_.solve); !ok) {
    report_.status = WindowUpdate::Status::solve_failed;
    report_.error = ok.error();
    return recover();  // the next update tries again
  }
  seen_version_ = graph().version();
}

// What the update before began; before anything new comes in, so that all states that are there were in that solve.
void SlidingWindow::merge() {
  if (!core_.has_begun()) return;
  const bool edited = graph().version() != seen_version_;  // by the user, since then
  report_.status = WindowUpdate::Status::updated;
  report_.solve = core_.finish_solve();
  states_.follow(graph());
  const bool solved = conclude_solve();
  if (solved && !options_.slide_before_solve) slide();
  if (!edited) seen_version_ = graph().version();
  if (!solved) recover();
}

// Keeps the memory of the one before.
void SlidingWindow::begin_report() {
  std::vector<Refusals> counts = std::move(report_.refusals);
  report_ = WindowUpdate{};
  counts.assign(static_cast<std::size_t>(pending_.sensors()), Refusals{});
  report_.refusals = std::move(counts);
}

void SlidingWindow::drain() {
  for (std::size_t k = 0; k < builders_.size(); ++k) {
    pending_.set_sensor(builder_sensors_[k], static_cast<int>(k));
    builders_[k]->drain(graph(), states_, pending_);
  }
  pending_.set_sensor(0);
}

bool SlidingWindow::solve() {
  report_.solve = core_.solve(options_.solve);
  return conclude_solve();
}

bool SlidingWindow::conclude_solve() {
  if (!report_.solve.failed()) {
    failures_ = 0;
    states_.mark_solved();
    return true;
  }
  report_.status = WindowUpdate::Status::solve_failed;
  return false;
}

// What made it fail leaves, if it can be told, so that the next update has something new to do and goes on.
void SlidingWindow::recover() {
  if (auto ok = core_.remove_overflowing(report_.expelled); !ok) report_.error = ok.error();
  states_.follow(graph());
  if (options_.failures_before_reset <= 0 || ++failures_ < options_.failures_before_reset) return;
  Time newest = States::kNever;
  for (int k = 0; k < states_.providers(); ++k)
    if (const State* latest = states_.timeline({k}).latest()) newest = std::max(newest, latest->time);
  begin_anew("so many solves have failed, one after the other", newest + Duration{1});
}

void SlidingWindow::begin_anew(const char* reason, Time horizon) {
  GraphEdit& edit = core_.edit();
  for (int k = 0; k < states_.providers(); ++k) {
    if (const State* last = states_.timeline({k}).latest()) states_.provider({k}).ended(graph(), *last);
    for (const State& s : states_.timeline({k}))
      for (const VariableKey id : s.all()) edit.remove(id);
  }
  for (const auto& pool : graph().pools())
    for (std::uint32_t d = 0; pool->ops().landmark && d < pool->extent(); ++d)
      if (pool->slots().is_live(d)) edit.remove(VariableKey{pool->ops().key, pool->slots().key(d)});
  if (auto ok = core_.commit(); !ok) report_.error = ok.error();
  core_.begin_anew();
  states_.clear(horizon);
  failures_ = 0;
  for (auto& builder : builders_) builder->reset();
  for (auto& builder : batch_builders_) builder->reset();
  for (auto& hook : hooks_) hook->reset();
  if (policy_) policy_->reset();
  if (late_) late_->reset();
  report_.reset = reason;
}

}  // namespace oriel
