// The engines of the program oriel.
#include "apps/engine_choice.h"

namespace oriel::apps {

NameTable<NamedEngine> engines() { return shipped_engines(); }

}  // namespace oriel::apps
