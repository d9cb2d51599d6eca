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

[[noreturn]] inline void contract_violated(const std::string& what) { throw ContractViolation(what); }

inline void check(bool holds, const char* what) {
  if (!holds) [[unlikely]]
    contract_violated(what);
}

}  // namespace oriel
