// What a user of the installed package sees: the headers, the library, and the user's own flags (no -march of ours).
#include <cstdio>

#include "oriel/base/matrix.h"
#include "oriel/base/time.h"

int main() {
  const oriel::Vec3d p_world_beacon{4, 0, 1}, p_world_body{1, 4, 1};
  const double range = (p_world_beacon - p_world_body).norm();  // [m], a 3-4-5 triangle
  const oriel::Duration elapsed = oriel::Time{3} - oriel::Time{1};
  std::printf("range %.3f m after %lld ns\n", range, static_cast<long long>(elapsed.ns));
  return range == 5.0 && elapsed.ns == 2 ? 0 : 1;
}
