#include "oriel/run/assembled_window.h"

namespace oriel {
namespace {

PartChoice chosen(const NameTable<WindowPart>& table, const char* name) {
  const WindowPart* part = table.get(name);
  return {name, part != nullptr ? part->defaults : AnyOptions()};
}

}  // namespace

WindowPlan default_plan(const WindowParts& parts) {
  WindowPlan plan;
  plan.providers = {chosen(parts.providers, "imu")};
  plan.builders = {chosen(parts.builders, "tracks")};
  plan.hooks = {chosen(parts.hooks, "refine"), chosen(parts.hooks, "cheirality"), chosen(parts.hooks, "standstill")};
  plan.policy = chosen(parts.policies, "keyframes");
  return plan;
}

AssembledWindow::AssembledWindow(const WindowPlan& plan, const SensorSuite& sensors)
    : sensors_(sensors), window_(plan.window), assembly_(window_, sensors_, plan.initialisation) {}

Result<std::unique_ptr<AssembledWindow>> AssembledWindow::make(const WindowPlan& plan, const WindowParts& parts,
                                                               const SensorSuite& sensors) {
  std::unique_ptr<AssembledWindow> made(new AssembledWindow(plan, sensors));
  Result<void> ok;
  if (plan.providers.empty()) ok = Error{ErrorCode::bad_input, "a window needs a provider"};
  if (plan.builders.empty()) ok = Error{ErrorCode::bad_input, "a window needs a builder"};
  for (std::size_t k = 0; ok && k < plan.providers.size(); ++k) ok = made->make(plan.providers[k], parts.providers);
  for (std::size_t k = 0; ok && k < plan.builders.size(); ++k) ok = made->make(plan.builders[k], parts.builders);
  for (std::size_t k = 0; ok && k < plan.hooks.size(); ++k) ok = made->make(plan.hooks[k], parts.hooks);
  if (ok && !plan.policy.name.empty()) ok = made->make(plan.policy, parts.policies);
  if (!ok) return ok.error();
  made->begun_ = made->assembly_.start_ == nullptr;
  return made;
}

Result<void> AssembledWindow::make(const PartChoice& choice, const NameTable<WindowPart>& table) {
  const WindowPart* part = table.get(choice.name);
  Result<void> ok = part == nullptr ? Result<void>(table.unknown(choice.name)) : Result<void>();
  assembly_.name_ = choice.name;
  if (ok) ok = part->make(choice.options, assembly_);
  if (ok) return ok;
  Error error = ok.error();
  if (part != nullptr) error.message = "the " + table.what() + " " + choice.name + ": " + error.message;
  error.file = choice.file;
  error.line = choice.line;
  return error;
}

Result<void> AssembledWindow::add(const ImuSample& sample) {
  Result<void> all;
  for (auto& take : assembly_.imu_)
    if (auto ok = take(sample); !ok) all = ok;
  return all;
}

Result<void> AssembledWindow::add(const MeasuredMotion& motion) {
  Result<void> all;
  for (auto& take : assembly_.motions_)
    if (auto ok = take(motion); !ok) all = ok;
  return all;
}

void AssembledWindow::add(const MeasuredPosition& position) {
  for (auto& take : assembly_.positions_) take(position);
}

const WindowUpdate& AssembledWindow::give(const StereoFrame& frame) {
  for (auto& take : assembly_.frames_) take(frame);
  return window_.update();
}

const WindowUpdate* AssembledWindow::update(const StereoFrame& frame) {
  if (begun_) return &give(frame);
  WindowStart& start = *assembly_.start_;
  if (!start.add(frame)) return nullptr;
  begun_ = true;
  const WindowUpdate* last = nullptr;
  for (std::size_t k = 0; k < start.frames(); ++k) last = &give(start.frame(k));
  assembly_.start_.reset();
  return last;
}

const char* AssembledWindow::waiting_for() const { return begun_ ? "" : assembly_.start_->reason(); }

std::vector<std::pair<std::string, std::int64_t>> AssembledWindow::counts() const {
  std::vector<std::pair<std::string, std::int64_t>> all;
  for (const auto& [name, of] : assembly_.counts_) all.emplace_back(name, of());
  return all;
}

}  // namespace oriel
