// TrackBuilder: stereo or mono tracks of points → landmarks and reprojection factors.
//
// Every frame is a state. A landmark starts with the second sighting at the latest that says where it is, by
// triangulation from the poses that are known then; the first sighting anchors it. Each sighting is handed over once,
// and never again: what left the window with a landmark (policy `close`) is used up, and a track that goes on begins a
// new landmark from sightings that were in no factor yet.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "oriel/residual/loss.h"
#include "oriel/window/factor_builder.h"
#include "oriel/window/track_geometry.h"

namespace oriel {

enum class LandmarkKind {
  inverse_depth,  // along the first sighting's bearing; goes when that sighting's state goes
  point,          // in world; with LandmarkPolicy::keep it stays while anything sees it
};

struct TrackBuilderOptions {
  LandmarkKind landmarks = LandmarkKind::inverse_depth;
  bool stereo = true;        // false: camera 1 is not looked at
  double pixel_sigma = 1.0;  // of a coordinate [px]
  Loss loss = Cauchy(2.0);
  // Before a slide: a sighting that lies further off than this is taken out, and does not enter the prior [px]; 0:
  // none.
  double gate = 5.0;
  TrackLimits limits;
  std::size_t expected_tracks = 2048, expected_states = 24;  // more may ask for memory
};

class TrackBuilder final : public FactorBuilder {
 public:
  // `rig_id`: the rig as a constant of the window's graph.
  TrackBuilder(ProviderId poses, const StereoRigd& rig, VariableId<StereoRigd> rig_id,
               const TrackBuilderOptions& options = {});

  // Its features are copied; they go in with the next update.
  void add(const StereoFrame& frame);

  std::string_view name() const override { return "tracks"; }
  void drain(const Graph& graph, const States& states, PendingFactors& pending) override;
  void entered(std::uint64_t group, std::span<const VariableKey> variables, std::span<const FactorId> factors) override;
  void refused(std::uint64_t group) override;
  void before_slide(const Graph& graph, const States& states, std::span<const VariableKey> leaving,
                    GraphEdit& edit) override;
  void after_slide(const Graph& graph, const States& states) override;
  void reset() override;

  const TrackMap& map() const { return map_; }
  FrameOverlap overlap(const Graph& graph, const States& states, Time earlier, Time later) const;
  double motion(Time earlier, Time later) const { return track_motion(map_, earlier, later, scratch_); }

  struct Counts {
    std::int64_t no_ray = 0;               // sightings whose pixel no ray of the camera's model explains
    std::int64_t handed = 0;               // sightings that went into a group
    std::int64_t gated = 0;                // sightings that were taken out before a slide
    std::int64_t refused = 0;              // sightings of groups that were refused
    std::int64_t repeated = 0;             // frames with a stamp that was there already
    std::int64_t started = 0, closed = 0;  // landmarks
  };
  const Counts& counts() const { return counts_; }

 private:
  struct Frame {
    Time time;
    std::vector<FeatureObservation> features;
  };
  // What a group that has not been settled holds, in the order of its variables and factors.
  struct Sent {
    struct Handed {
      std::int64_t track;
      Time time;
    };
    std::uint64_t number = 0;  // 0: not in use
    Time time;
    std::vector<std::int64_t> starts;
    std::vector<Handed> factors;
  };
  struct InFlight {  // by place in the map
    std::int64_t track = 0;
    std::uint64_t group = 0;
  };

  void hand(const Graph& graph, const States& states, const Frame& frame, PendingFactors& pending);
  void extend(const States& states, Track& track, PendingFactors& pending);
  void start(const Graph& graph, const States& states, std::uint32_t place, PendingFactors& pending);
  void add_factor(PendingFactors& pending, VariableKey landmark, const Track& track, Sighting& sighting);
  void add_anchored(PendingFactors& pending, VariableId<InverseDepthd> landmark, const Sighting& anchor,
                    const Sighting& sighting);
  void add_point(PendingFactors& pending, VariableId<Point3d> landmark, const Sighting& sighting);
  Vec3d position(const Graph& graph, const States& states, const Track& track) const;
  bool has_state(const States& states, Time time) const;
  bool only_removed(const States& states, const Track& track) const;
  void gate(const Graph& graph, const States& states, Track& track, GraphEdit& edit);
  bool has_other_factors(const Graph& graph, const Track& track) const;
  // What was handed over is used up; the track goes on without a landmark.
  void begin_anew(Track& track);
  void retire(const Track& track);
  bool in_flight(std::uint32_t place) const;
  VariableKey key_of(const Track& track) const;
  Sent& free_sent();
  Sent* sent_of(std::uint64_t group);

  ProviderId poses_;
  VariableId<StereoRigd> rig_id_;
  TrackBuilderOptions options_;
  TrackGeometry geometry_;
  TrackMap map_;
  std::vector<Frame> frames_;
  std::size_t waiting_ = 0;  // frames that go in with the next drain
  std::vector<Sent> sent_;
  Sent* filling_ = nullptr;
  std::vector<InFlight> in_flight_;
  std::vector<VariableKey> retired_;  // landmarks that no track has any more
  Counts counts_;
  std::vector<std::uint32_t> seen_;
  std::vector<PlacedSighting> placed_;
  mutable std::vector<double> scratch_;
};

}  // namespace oriel
