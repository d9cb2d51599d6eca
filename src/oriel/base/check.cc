#include "oriel/base/check.h"

namespace oriel {

void contract_violated(const std::string& what) { throw ContractViolation(what); }
void contract_violated(const char* what) { throw ContractViolation(what); }

}  // namespace oriel
