// The engines of the program oriel-ceres.
#include "apps/engine_choice.h"
#include "oriel/engines/ceres/ceres_engine.h"

namespace oriel::apps {

NameTable<NamedEngine> engines() {
  NameTable<NamedEngine> all = shipped_engines();
  const auto make = [](Graph& graph) -> std::unique_ptr<Engine> { return std::make_unique<CeresEngine>(graph); };
  check(all.replace("ceres", {make, "Ceres Solver."}).ok(), "the engine ceres has a name");
  return all;
}

}  // namespace oriel::apps
