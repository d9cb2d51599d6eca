#include "oriel/base/result.h"

#include "oriel/base/check.h"

namespace oriel {

// Appended piece by piece: GCC 12 warns of overlaps that are not there where strings are added up (GCC bug 105651).
std::string Error::text() const {
  std::string out = file;
  if (!file.empty()) {
    if (line > 0) out.append(":").append(std::to_string(line));
    out.append(": ");
  }
  return out.append(message);
}

std::ostream& operator<<(std::ostream& out, const Error& e) { return out << e.text(); }

namespace detail {
void value_of_error(const Error& error) {
  std::string what = "Result::value() of an error: ";
  contract_violated(what.append(error.text()));
}
void error_of_value() { contract_violated("Result::error() of a result that holds a value"); }
}  // namespace detail

}  // namespace oriel
