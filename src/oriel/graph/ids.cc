#include "oriel/graph/ids.h"

namespace oriel {

Label::Label(std::string t, std::int64_t number) : text(std::move(t)) { text.append(std::to_string(number)); }

}  // namespace oriel
