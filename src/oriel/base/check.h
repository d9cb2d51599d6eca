// A broken contract (a stale id handed to `value`, an index out of range) is a bug of the caller: it fails loudly.
// Bad *input* never comes here, it is a Result (base/result.h).
#pragma once
#include <stdexcept>
#include <string>

namespace oriel {

// Thrown by accessors whose contract was broken. Inside apply, adopt, update and solve (all noexcept) it terminates.
class ContractViolation : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

// Compiled in the library, so that who only checks compiles no strings.
[[noreturn]] void contract_violated(const std::string& what);
[[noreturn]] void contract_violated(const char* what);

inline void check(bool holds, const char* what) {
  if (!holds) [[unlikely]]
    contract_violated(what);
}

}  // namespace oriel
