// A robust loss as it is written on a command line and in a config.
#pragma once
#include <string>

#include "oriel/base/result.h"
#include "oriel/residual/loss.h"

namespace oriel {

// NAME:SCALE, SCALE > 0 in whitened units; barron:SCALE:ALPHA with ALPHA <= 2 (or -inf); or none.
Result<Loss> parse_loss(const std::string& text);

}  // namespace oriel
