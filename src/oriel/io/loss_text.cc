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

std::string spelling(const std::string& name, const NamedLoss& named) {
  return name + (named.has_shape ? ":SCALE:ALPHA" : ":SCALE");
}

}  // namespace

std::string loss_spellings(const NameTable<NamedLoss>& losses) {
  std::string all = "none";
  bool shapes = false;
  for (std::size_t k = 0; k < losses.size(); ++k) {
    const auto& [name, named] = losses.items()[k];
    all += (k + 1 < losses.size() ? ", " : " or ") + spelling(name, named);
    shapes = shapes || named.has_shape;
  }
  return all + " with SCALE > 0" + (shapes ? " and ALPHA <= 2" : "");
}

Result<Loss> parse_loss(const std::string& text, const NameTable<NamedLoss>& losses) {
  if (text == "none") return Loss::none();
  const Error fault{ErrorCode::bad_input, "expected " + loss_spellings(losses) + ", found " + quote_token(text)};
  const std::size_t colon = text.find(':');
  const NamedLoss* named = losses.get(text.substr(0, colon));
  if (named == nullptr || colon == std::string::npos) return fault;
  const std::size_t second = text.find(':', colon + 1);
  Loss loss = named->loss;
  if (parse_number(text.substr(colon + 1, second - colon - 1), loss.scale) != NumberFault::none) return fault;
  if (named->has_shape != (second != std::string::npos)) return fault;
  if (named->has_shape && !parse_shape(text.substr(second + 1), loss.shape)) return fault;
  if (!fault_of(loss).empty()) return fault;
  return loss;
}

std::string loss_text(const Loss& loss, const NameTable<NamedLoss>& losses) {
  for (const auto& [name, named] : losses.items()) {
    if (named.loss.kind != loss.kind || named.loss.ops != loss.ops) continue;
    std::string text = name + ':';
    append_number(text, loss.scale);
    if (!named.has_shape) return text;
    text += ':';
    if (loss.shape < -1e300)
      text += "-inf";
    else
      append_number(text, loss.shape);
    return text;
  }
  return "none";
}

}  // namespace oriel
