// Settings as they are written in a config.
#include "oriel/io/loss_text.h"
#include "oriel/io/run_config_keys.h"
#include "oriel/io/text.h"

namespace oriel::io_detail {
namespace {

using namespace setting;

std::string number(double x) {
  std::string out;
  append_number(out, x);
  return out;
}

// What was expected where the text is none; empty where it is, and then it was set.
struct Set {
  void* options;
  const std::string& text;
  const NameTable<NamedLoss>& losses;

  std::string operator()(const Word& w) const { return w.set(options, text) ? "" : "one of " + w.list(); }
  std::string operator()(const Real& r) const {
    double x = 0.0;
    if (parse_number(text, x) != NumberFault::none || x < r.least || x > r.greatest)
      return "a number from " + number(r.least) + " to " + number(r.greatest);
    r.at(options) = x;
    return {};
  }
  std::string operator()(const Whole& w) const {
    std::int64_t x = 0;
    if (parse_integer(text, x) != NumberFault::none || x < w.least || x > w.greatest)
      return "a whole number from " + std::to_string(w.least) + " to " + std::to_string(w.greatest);
    w.at(options) = static_cast<int>(x);
    return {};
  }
  std::string operator()(const Count& c) const {
    std::int64_t x = 0;
    if (parse_integer(text, x) != NumberFault::none || x < 0 || static_cast<std::uint64_t>(x) > c.greatest)
      return "a whole number from 0 to " + std::to_string(c.greatest);
    c.at(options) = static_cast<std::uint64_t>(x);
    return {};
  }
  std::string operator()(const Seconds& s) const {
    double x = 0.0;
    const bool zero = parse_number(text, x) == NumberFault::none && x == 0.0 && s.may_be_zero;
    // Less would be 0 in nanoseconds.
    if (!zero && (parse_number(text, x) != NumberFault::none || x < 1e-9 || x > 1e9))
      return std::string(s.may_be_zero ? "0, or " : "") + "a number of seconds from 1e-09 to 1e+09";
    s.at(options) = Duration::from_seconds(x);
    return {};
  }
  std::string operator()(const Flag& f) const {
    if (text != "true" && text != "false") return "true or false";
    f.at(options) = text == "true";
    return {};
  }
  std::string operator()(const Robust& r) const {
    const auto loss = parse_loss(text, losses);
    if (!loss) return loss_spellings(losses);
    r.at(options) = *loss;
    return {};
  }
  std::string operator()(const Choice& c) const {
    std::string list;
    for (const std::string& name : c.names) {
      if (name == text) return c.at(options) = text, std::string();
      list += (list.empty() ? "" : ", ") + name;
    }
    return "one of " + list;
  }
  std::string operator()(const Reference& r) const { return r.at(options) = text, std::string(); }
};

struct Print {
  void* options;
  const NameTable<NamedLoss>& losses;

  std::string operator()(const Word& w) const { return w.get(options); }
  std::string operator()(const Real& r) const { return number(r.at(options)); }
  std::string operator()(const Whole& w) const { return std::to_string(w.at(options)); }
  std::string operator()(const Count& c) const { return std::to_string(c.at(options)); }
  std::string operator()(const Seconds& s) const { return number(static_cast<double>(s.at(options).ns) / 1e9); }
  std::string operator()(const Flag& f) const { return f.at(options) ? "true" : "false"; }
  std::string operator()(const Robust& r) const { return loss_text(r.at(options), losses); }
  std::string operator()(const Choice& c) const { return c.at(options); }
  std::string operator()(const Reference& r) const { return r.at(options).empty() ? "''" : r.at(options); }
};

// Where it says more than that a number is positive.
std::string range_of(const setting::Kind& kind) {
  using setting::kTiny, setting::kHuge;
  if (const auto* r = std::get_if<Real>(&kind); r != nullptr && (r->least != kTiny || r->greatest != kHuge))
    return " " + number(r->least) + " to " + number(r->greatest) + ".";
  if (const auto* w = std::get_if<Whole>(&kind))
    return " " + std::to_string(w->least) + " to " + std::to_string(w->greatest) + ".";
  if (const auto* c = std::get_if<Count>(&kind); c != nullptr && c->greatest != Count::kMost)
    return " 0 to " + std::to_string(c->greatest) + ".";
  return {};
}

}  // namespace

std::string set_setting(const setting::Kind& kind, void* options, const std::string& text,
                        const NameTable<NamedLoss>& losses) {
  return std::visit(Set{options, text, losses}, kind);
}

std::string setting_text(const setting::Kind& kind, void* options, const NameTable<NamedLoss>& losses) {
  return std::visit(Print{options, losses}, kind);
}

std::string setting_comment(const setting::Kind& kind, const std::string& unit, const std::string& sentence) {
  std::string out = sentence + range_of(kind);
  if (const auto* word = std::get_if<Word>(&kind)) out += " " + word->list() + ".";
  if (const auto* choice = std::get_if<Choice>(&kind)) {
    std::string list;
    for (const std::string& name : choice->names) list += (list.empty() ? "" : ", ") + name;
    out += " " + list + ".";
  }
  return unit == "-" ? out : out + " [" + unit + "]";
}

}  // namespace oriel::io_detail
