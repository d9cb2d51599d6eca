#include "apps/recording_rig.h"

namespace oriel::apps {

StereoRigd rig_of(const Recording& recording) {
  StereoRigd rig;
  for (std::size_t c = 0; c < recording.cameras.size() && c < 2; ++c) {
    const RecordedCamera& k = recording.cameras[c];
    rig.cameras[c] = {RadTanCamerad{k.fx, k.fy, k.cx, k.cy, k.k1, k.k2, k.p1, k.p2},
                      {Rot3d::from_matrix(k.R_body_camera), k.p_body_camera}};
  }
  return rig;
}

}  // namespace oriel::apps
