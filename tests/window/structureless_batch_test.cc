// Tracks without their landmark in a linear world: rebuilt at every update, landmarks when a state leaves, and always
// what dense least squares over all sightings says.
#include <gtest/gtest.h>

#include <map>

#include "linear_window.h"
#include "oriel/graph/fingerprint.h"

namespace oriel {
namespace {

using namespace linear_world;
using Status = WindowUpdate::Status;

// What N sightings of a landmark say about the positions, the landmark projected out: landmark = x_i + z_i, so that the
// contrasts of those sums are zero. Rows of Helmert: (Σ_{j<i} s_j - i s_i) / √(i (i + 1)), i = 1 … N - 1, s = x + z.
constexpr std::string_view kContrastNames[] = {
    "", "", "test.contrast2/1", "test.contrast3/1", "test.contrast4/1", "test.contrast5/1"};
template <int N, class>
struct ContrastOf;
template <int N, std::size_t... I>
struct ContrastOf<N, std::index_sequence<I...>> {
  static constexpr std::string_view kName = kContrastNames[N];
  static constexpr int kDim = 2 * (N - 1);
  template <std::size_t>
  using Each = Position;
  using Variables = Types<Each<I>...>;
  std::array<Vec2d, N> z;

  template <class S, class... Rest>
  Vec<S, 2 * (N - 1)> operator()(const VectorN<S, 2>& first, const Rest&... rest) const {
    const std::array<VectorN<S, 2>, N> x = {first, rest...};
    Vec<S, 2> sum = first.v + z[0].template cast<S>();
    Vec<S, 2 * (N - 1)> r;
    for (int i = 1; i < N; ++i) {
      const Vec<S, 2> s = x[i].v + z[i].template cast<S>();
      for (int c = 0; c < 2; ++c)
        r[2 * (i - 1) + c] = (sum[c] - s[c] * static_cast<double>(i)) * (1.0 / std::sqrt(1.0 * i * (i + 1)));
      sum += s;
    }
    return r;
  }
};
template <int N>
using Contrast = ContrastOf<N, std::make_index_sequence<N>>;

class ContrastBuilder final : public BatchFactorBuilder {
 public:
  static constexpr double kSigma = 0.2;
  ProviderId positions;
  struct Seen {
    Time time;
    Vec2d z;
  };
  struct Track {
    std::vector<Seen> seen;
    FactorId factor;  // of them all; table 0: none
    bool is_point = false;
    VariableId<Point2d> point;
    std::size_t in_graph = 0;  // of a point: its first sightings
  };
  std::map<int, Track> tracks;
  int points = 0;

  std::string_view name() const override { return "contrasts"; }
  void wanted(std::vector<std::pair<ProviderId, Time>>& times) const override {
    for (const auto& [number, track] : tracks)
      for (const Seen& s : track.seen) times.push_back({positions, s.time});
  }
  Result<bool> rebuild(const Graph&, const States& states, GraphEdit& edit) override {
    bool changed = false;
    for (auto& [number, t] : tracks) {
      for (; t.is_point && t.in_graph < t.seen.size(); ++t.in_graph, changed = true)
        sight(edit, states, t, t.seen[t.in_graph]);
      if (t.is_point || t.seen.size() < 2 || t.seen.size() == t.in_graph) continue;
      if (t.factor.table != 0) edit.remove(t.factor);
      add(edit, states, t);
      t.in_graph = t.seen.size(), changed = true;
    }
    return changed;
  }
  void refused() override { ADD_FAILURE() << "refused"; }
  // Tracks that lose a state get their landmark: the same information, and sightings that can stay.
  void before_slide(const Graph&, const States& states, std::span<const VariableKey> leaving,
                    GraphEdit& edit) override {
    for (auto& [number, t] : tracks) {
      const bool loses = std::any_of(t.seen.begin(), t.seen.end(), [&](const Seen& s) {
        return std::find(leaving.begin(), leaving.end(), position(states, s.time)) != leaving.end();
      });
      if (!loses || t.is_point) continue;
      if (t.factor.table != 0) edit.remove(t.factor);
      t.factor = {};
      t.is_point = true, ++points;
      t.point = edit.add(Point2d{});
      for (const Seen& s : t.seen) sight(edit, states, t, s);
      t.in_graph = t.seen.size();
    }
  }
  void after_slide(const Graph& graph, const States& states) override {
    for (auto t = tracks.begin(); t != tracks.end();) {
      auto& seen = t->second.seen;
      const std::size_t before = seen.size();
      std::erase_if(seen, [&](const Seen& s) { return states.timeline(positions).find(s.time) == nullptr; });
      t->second.in_graph -= before - seen.size();
      if (t->second.is_point && !graph.contains(t->second.point)) {
        EXPECT_TRUE(seen.empty());
        t = tracks.erase(t);
      } else {
        ++t;
      }
    }
  }
  void reset() override { tracks.clear(); }

 private:
  VariableKey position(const States& states, Time time) const {
    return states.find(positions, time, kVariableOps<Position>.key);
  }
  void sight(GraphEdit& edit, const States& states, const Track& t, const Seen& s) const {
    edit.add(Sight{s.z}, Sigma(kSigma), VariableId<Position>{position(states, s.time).key}, t.point);
  }
  void add(GraphEdit& edit, const States& states, Track& t) const {
    switch (t.seen.size()) {
      case 2:
        return add<2>(edit, states, t);
      case 3:
        return add<3>(edit, states, t);
      case 4:
        return add<4>(edit, states, t);
      default:
        return add<5>(edit, states, t);
    }
  }
  template <int N>
  void add(GraphEdit& edit, const States& states, Track& t) const {
    ASSERT_EQ(t.seen.size(), static_cast<std::size_t>(N));
    Contrast<N> c;
    for (int i = 0; i < N; ++i) c.z[i] = t.seen[i].z;
    [&]<std::size_t... I>(std::index_sequence<I...>) {
      t.factor = edit.add(c, Sigma(kSigma), VariableId<Position>{position(states, t.seen[I].time).key}...);
    }
    (std::make_index_sequence<N>{});
  }
};

// W10, W12
TEST(StructurelessBatch, IsTheBatchOfAllSightingsHoweverOftenItSlid) {
  for (const bool slide_first : {false, true}) {
    WindowOptions options = LinearWindow::exact();
    options.slide_before_solve = slide_first;
    LinearWindow w(4, 31, options);
    auto owned = std::make_unique<ContrastBuilder>();
    ContrastBuilder& tracks = *owned;
    tracks.positions = w.positions;
    w.window.add(std::move(owned));
    int most_factors = 0;
    for (int k = 0; k < 40; ++k) {
      w.move_to(100 * k + 100);
      w.give({w.position_at(100 * k)});
      // Each track is seen for a while: two frames (it never leaves as a point), up to eight.
      for (int l = 0; l <= k; ++l) {
        if (k >= l + 2 + l % 7) continue;
        Measured m = w.sight(100 * k, l);
        m.sigma = ContrastBuilder::kSigma;
        tracks.tracks[l].seen.push_back({m.a, {{m.z[0], m.z[1]}}});
        w.builder->taken.push_back({m});  // for the truth
        w.builder->taken_factors.emplace_back();
      }
      const WindowUpdate& update = w.window.update();
      ASSERT_EQ(update.status, Status::updated) << update.error.message;
      ASSERT_LT(w.error(), 1e-9) << "frame " << k;
      int factors = 0;
      for (const auto& [number, t] : tracks.tracks) {
        factors += t.factor.table != 0 ? 1 : 0;
        EXPECT_FALSE(t.is_point && t.factor.table != 0);
        EXPECT_TRUE(t.factor.table == 0 || w.window.graph().contains(t.factor));
      }
      most_factors = std::max(most_factors, factors);
      const std::uint64_t same = fingerprint(w.window.graph());
      EXPECT_EQ(w.window.update().status, Status::nothing_new);
      EXPECT_EQ(fingerprint(w.window.graph()), same);
    }
    EXPECT_GT(most_factors, 2);
    EXPECT_GT(tracks.points, 15);
  }
}

}  // namespace
}  // namespace oriel
