// What stands in for a front end that finds features: CPU time.
#pragma once

namespace oriel::apps {

// Of the calling thread [ms]; back at once for 0.
void burn_cpu(double ms);

}  // namespace oriel::apps
