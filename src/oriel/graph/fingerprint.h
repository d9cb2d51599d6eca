// One number for the whole of a graph: equal graphs have equal fingerprints, in whatever order they were built.
#pragma once
#include <cstdint>

#include "oriel/graph/graph.h"

namespace oriel {

// Over everything that a solver can see, by its bits and in canonical order (types by name, rows by serial): ids,
// serials, values, fixed flags, first estimates; measurements, noises, losses and variables of factors; linear priors.
// Not over versions, labels, free slots, or the order in which tables came to be. A refused edit leaves it as it was
// (V5); a follower that saw everything has the origin's (C1), values included where it solved or adopted as often.
std::uint64_t fingerprint(const Graph& graph);

// Over the values alone, in the same order (R1: what two engines found has the same bits).
std::uint64_t value_fingerprint(const Graph& graph);

}  // namespace oriel
