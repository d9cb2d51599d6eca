#include "oriel/run/window_parts.h"

namespace oriel {

ProviderId WindowAssembly::add(std::unique_ptr<StateProvider> provider) {
  const ProviderId id = window_.add(std::move(provider));
  providers_.emplace_back(name_, id);
  return id;
}

int WindowAssembly::add(std::unique_ptr<FactorBuilder> builder) {
  const int sensor = window_.add(std::move(builder));
  sensors_of_.emplace_back(name_, sensor);
  return sensor;
}

int WindowAssembly::add(std::unique_ptr<BatchFactorBuilder> builder) {
  const int sensor = window_.add(std::move(builder));
  sensors_of_.emplace_back(name_, sensor);
  return sensor;
}

Result<ProviderId> WindowAssembly::provider(std::string_view name) const {
  if (providers_.empty()) return Error{ErrorCode::not_found, "expected a provider, found none"};
  for (const auto& [known, id] : providers_)
    if (name.empty() || known == name) return id;
  return Error{ErrorCode::not_found,
               "expected the name of a provider of this window, found '" + std::string(name) + "'"};
}

Result<ProviderId> WindowAssembly::provider_of(std::string_view name, std::uint64_t type, const char* what) const {
  const auto id = provider(name);
  if (!id || window_.states().place_of(*id, type) >= 0) return id;
  return Error{ErrorCode::bad_input, std::string("expected a provider whose states have ") + what};
}

Result<int> WindowAssembly::sensor(std::string_view builder) const {
  if (sensors_of_.empty()) return Error{ErrorCode::not_found, "expected a builder, found none"};
  for (const auto& [known, sensor] : sensors_of_)
    if (builder.empty() || known == builder) return sensor;
  return Error{ErrorCode::not_found,
               "expected the name of a builder of this window, found '" + std::string(builder) + "'"};
}

Result<VariableId<StereoRigd>> WindowAssembly::rig() {
  if (sensors_.cameras < 1) return Error{ErrorCode::bad_input, "expected a recording with a camera"};
  if (has_rig_) return rig_;
  rig_ = window_.core().edit().add(sensors_.rig);
  if (auto ok = window_.core().commit(); !ok) return ok.error();
  has_rig_ = true;
  return rig_;
}

}  // namespace oriel
