// A robust loss as it is written on a command line and in a config.
#pragma once
#include <string>

#include "oriel/base/result.h"
#include "oriel/run/run_names.h"

namespace oriel {

// NAME:SCALE, SCALE > 0 in whitened units, NAME out of the table; NAME:SCALE:SHAPE where the loss has a shape
// (barron:SCALE:ALPHA with ALPHA <= 2, or -inf); or none. What none of these is, is an error that lists them.
Result<Loss> parse_loss(const std::string& text, const NameTable<NamedLoss>& losses = shipped_losses());
std::string loss_spellings(const NameTable<NamedLoss>& losses);  // how they are written, with commas
// So that parse_loss takes it back; "none" for a loss that is not in the table.
std::string loss_text(const Loss& loss, const NameTable<NamedLoss>& losses = shipped_losses());

}  // namespace oriel
