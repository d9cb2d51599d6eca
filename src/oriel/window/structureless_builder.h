// StructurelessBuilder: tracks of points → factors between poses alone, each of a whole track with its point projected
// out (residual/structureless_track.h). They are smaller than landmarks while tracks are short and the window is solved
// in few iterations, and no point can go astray.
//
// At every update each track that grew gets a factor anew, of all its sightings (behaviour W10). A track that has more
// sightings than a factor can hold (8) gets its point as a variable, which says the same. When a state leaves:
//   Leaving::landmark  tracks that the newest state still sees get their point as a variable: nothing is lost if the
//                      window keeps landmarks (LandmarkPolicy::keep);
//   Leaving::absorb    the whole track goes into the prior, and what is seen later begins anew: the two then know
//                      nothing of being one point, which is counted (lost_correlations).
// Never both, and never an observation twice.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/residual/loss.h"
#include "oriel/residual/structureless_track.h"
#include "oriel/window/factor_builder.h"
#include "oriel/window/track_geometry.h"

namespace oriel {

struct StructurelessOptions {
  enum class Leaving { landmark, absorb };
  Leaving leaving = Leaving::absorb;
  bool stereo = true;
  double pixel_sigma = 1.0;  // of a coordinate [px]
  Loss loss = Loss::none();  // of a track as a whole
  TrackLimits limits;
  std::size_t expected_tracks = 2048, expected_states = 24;  // more may ask for memory
};

class StructurelessBuilder final : public BatchFactorBuilder {
 public:
  StructurelessBuilder(ProviderId poses, const StereoRigd& rig, VariableId<StereoRigd> rig_id,
                       const StructurelessOptions& options = {});

  // Its features are copied; they go in with the next update that can make a state for them.
  void add(const StereoFrame& frame);

  std::string_view name() const override { return "structureless tracks"; }
  void wanted(std::vector<std::pair<ProviderId, Time>>& times) const override;
  Result<bool> rebuild(const Graph& graph, const States& states, GraphEdit& edit) override;
  void refused() override;
  void before_slide(const Graph& graph, const States& states, std::span<const VariableKey> leaving,
                    GraphEdit& edit) override;
  void after_slide(const Graph& graph, const States& states) override;
  void reset() override;

  const TrackMap& map() const { return map_; }
  FrameOverlap overlap(const Graph& graph, const States& states, Time earlier, Time later) const;

  struct Counts {
    std::int64_t no_ray = 0;             // sightings whose pixel no ray of the camera's model explains
    std::int64_t late = 0;               // frames whose state has left
    std::int64_t repeated = 0;           // frames with a stamp that was there already
    std::int64_t landmarks = 0;          // tracks that got their point as a variable
    std::int64_t lost_correlations = 0;  // tracks that were absorbed while they were seen, and began anew
  };
  const Counts& counts() const { return counts_; }
  // In the graph now.
  int factors() const;

 private:
  struct Frame {
    Time time;
    std::vector<FeatureObservation> features;
  };
  // What a place of the map has in the graph.
  struct Built {
    std::int64_t track = 0;
    FactorId factor;            // table 0: none
    std::size_t sightings = 0;  // that it is made of: the first of the track
    std::size_t tried = 0;      // sightings of the last attempt
  };
  struct Staged {
    std::uint32_t place;
    Built before;
    bool had_landmark;
  };

  void take_frames(const States& states);
  bool update_track(const Graph& graph, const States& states, std::uint32_t place, GraphEdit& edit);
  bool gather(const Graph& graph, const States& states, const Track& track);
  void make_landmark(std::uint32_t place, GraphEdit& edit);
  void add_sighting(GraphEdit& edit, Track& track, Sighting& s, VariableId<Pose3d> pose);
  bool extend_landmark(const States& states, std::uint32_t place, GraphEdit& edit);
  Built& built(std::uint32_t place);
  void settle(const Graph& graph, const States& states, std::uint32_t place);
  void begin_anew(std::uint32_t place, std::size_t used);
  void stage(std::uint32_t place);

  ProviderId poses_;
  VariableId<StereoRigd> rig_id_;
  StructurelessOptions options_;
  TrackGeometry geometry_;
  TrackMap map_;
  std::vector<Frame> frames_;
  std::size_t waiting_ = 0;
  std::vector<Built> built_;
  std::vector<Staged> staged_;
  std::vector<std::pair<std::uint32_t, Time>> staged_sightings_;  // of landmarks that were there
  std::vector<VariableKey> retired_;                              // landmarks that no track has any more
  Counts counts_;

  // Of the track at hand.
  std::vector<TrackView> views_;
  std::vector<Pose3d> values_;
  std::vector<const Pose3d*> pointers_;
  std::vector<VariableId<Pose3d>> ids_;
  std::vector<PlacedSighting> placed_;
  std::vector<std::uint32_t> seen_;
  mutable std::vector<double> scratch_;
};

}  // namespace oriel
