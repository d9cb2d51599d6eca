// Camera calibration from YAML, shared by the recording's own reader and by importers. Private to this room.
#pragma once
#include <vector>

#include "oriel/io/recording.h"
#include "oriel/io/yaml_fields.h"

namespace oriel::io_detail {

struct CameraKeys {
  const char *resolution, *intrinsics, *distortion;
  bool resolution_may_lack = false;
};

// Size, fx fy cx cy, k1 k2 p1 p2; a fault is left in `fields`.
void read_pinhole_radtan(YamlFields& fields, const CameraKeys& keys, RecordedCamera& camera);

// R and p from the rows of [R | p]. A calibration file has its digits rounded: R becomes the next rotation. False where
// R is further than 1e-3 from any.
bool set_camera_frame(const std::vector<double>& rows, RecordedCamera& camera);

}  // namespace oriel::io_detail
