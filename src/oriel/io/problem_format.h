// What a problem file holds, told by its content and not by its name.
#pragma once
#include <string>
#include <string_view>

#include "oriel/base/result.h"

namespace oriel {

enum class ProblemFormat { g2o, bal };

// g2o starts with a tag in capitals, BAL with a number; blank lines and comments come before either.
Result<ProblemFormat> detect_format(std::string_view text, const std::string& file_name);
Result<ProblemFormat> detect_format(const std::string& path);

}  // namespace oriel
