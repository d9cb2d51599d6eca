#include "oriel/io/loss_text.h"

#include <limits>

#include "oriel/io/text.h"

namespace oriel {
namespace {

// A number, or the words of one that is not finite.
bool parse_shape(const std::string& text, double& out) {
  if (text == "-inf") return out = -std::numeric_limits<double>::infinity(), true;
  return parse_number(text, out) == NumberFault::none;
}

}  // namespace

Result<Loss> parse_loss(const std::string& text) {
  if (text == "none") return Loss::none();
  const std::size_t colon = text.find(':'), second = text.find(':', colon + 1);
  const std::string name = text.substr(0, colon);
  double scale = 0, alpha = 0;
  const bool has_scale = colon != std::string::npos &&
                         parse_number(text.substr(colon + 1, second - colon - 1), scale) == NumberFault::none &&
                         scale > 0;
  const bool has_alpha = colon != std::string::npos && second != std::string::npos &&
                         parse_shape(text.substr(second + 1), alpha) && alpha <= 2.0;
  const bool one = has_scale && second == std::string::npos;
  if (one && name == "huber") return Huber(scale);
  if (one && name == "cauchy") return Cauchy(scale);
  if (one && name == "geman-mcclure") return GemanMcClure(scale);
  if (one && name == "tukey") return Tukey(scale);
  if (one && name == "truncated") return TruncatedSquares(scale);
  if (has_scale && has_alpha && name == "barron") return Barron(scale, alpha);
  return Error{ErrorCode::bad_input,
               "expected none, huber:SCALE, cauchy:SCALE, geman-mcclure:SCALE, tukey:SCALE, truncated:SCALE or "
               "barron:SCALE:ALPHA with SCALE > 0 and ALPHA <= 2, found " +
                   quote_token(text)};
}

}  // namespace oriel
