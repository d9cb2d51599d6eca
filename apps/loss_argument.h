// A robust loss as it is written on a command line.
#pragma once
#include <string>

#include "oriel/base/result.h"
#include "oriel/residual/loss.h"

namespace oriel::apps {

// NAME:SCALE, SCALE > 0 in whitened units; barron:SCALE:ALPHA with ALPHA <= 2 (or -inf); or none.
Result<Loss> parse_loss(const std::string& text);

}  // namespace oriel::apps
