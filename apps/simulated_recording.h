// A simulated world as a recording: what `oriel simulate` writes.
#pragma once
#include <string>
#include <vector>

#include "oriel/io/recording.h"
#include "oriel/testing/simulated_world.h"

namespace oriel::apps {

// "KIND:SENSOR:FROM:TO[:SHARE]", times in seconds since the start, e.g. "outlier:camera:10:11:0.5". Kinds: dropout,
// outlier, blind, saturation (SHARE: of the range). Those that no recording can hold are refused: its stamps rise and
// its numbers are finite.
Result<SimulatedFault> parse_fault(const std::string& text);
// "FROM:TO" [s].
Result<Interval> parse_interval(const std::string& text);

// Poses of a TUM file; columns after the eighth (covariances) are passed over. Errors as read_trajectory's.
Result<std::vector<StampedPose>> read_poses(const std::string& path);

// Runs the world to its end. The truth is said at each frame's stamp.
Recording record(SimulatedWorld& world, std::string name, std::string origin);

}  // namespace oriel::apps
