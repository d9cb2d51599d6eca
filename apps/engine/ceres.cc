// The engines of the program oriel-ceres.
#include "apps/engine_choice.h"
#include "oriel/engines/ceres/ceres_engine.h"
#include "oriel/solve/native_engine.h"

namespace oriel::apps {

bool has_engine(std::string_view name) { return name == "native" || name == "ceres"; }

std::unique_ptr<Engine> make_engine(std::string_view name, Graph& graph) {
  if (name == "native") return std::make_unique<NativeEngine>(graph);
  if (name == "ceres") return std::make_unique<CeresEngine>(graph);
  return nullptr;
}

}  // namespace oriel::apps
