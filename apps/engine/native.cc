// The engines of the program oriel.
#include "apps/engine_choice.h"
#include "oriel/solve/native_engine.h"

namespace oriel::apps {

bool has_engine(std::string_view name) { return name == "native"; }

std::unique_ptr<Engine> make_engine(std::string_view name, Graph& graph) {
  if (name == "native") return std::make_unique<NativeEngine>(graph);
  return nullptr;
}

}  // namespace oriel::apps
