// How many threads this process has.
#pragma once

namespace oriel {

int thread_count();  // 1 where the system does not tell

}  // namespace oriel
