// A factor builder and a loss of one's own, added to copies of the tables and named by a config.
#include <gtest/gtest.h>

#include "oriel/io/run_config.h"
#include "oriel/window/sensor_builder.h"
#include "window/simulated_flight.h"

namespace {

using namespace oriel;           // NOLINT(google-build-using-namespace): as a user would write it
using namespace oriel::setting;  // NOLINT(google-build-using-namespace)

// ---- what the user writes ----

// The body flies at a height that somebody knows.
struct Height {
  static constexpr std::string_view kName = "example.height/1";
  using Variables = Types<Pose3d>;
  double z;  // [m]
  template <class S>
  S operator()(const Pose3<S>& T_world_body) const {
    return T_world_body.translation()[2] - S(z);
  }
};

struct Saturating {  // at most c², however far the measurement is off
  static constexpr std::string_view kName = "example.saturating/1";
  static LossValue<double> evaluate(double c, double s) {
    const double u = 1.0 + s / (c * c);
    return {s / u, 1.0 / (u * u)};
  }
};

struct HeightOptions {
  std::string states;
  double height = 0.0, sigma = 0.1;
  Loss loss;
};

Result<void> make_height(const HeightOptions& o, WindowAssembly& window) {
  const auto body = window.provider_of(o.states, kVariableOps<Pose3d>.key, "a pose");
  if (!body) return body.error();
  auto builder = std::make_unique<SensorBuilder<Height, IsotropicNoise>>("height", *body, o.loss);
  window.on_frame([b = builder.get(), o](const StereoFrame& f) { b->add(f.time, Height{o.height}, Sigma(o.sigma)); });
  window.add(std::move(builder));
  return {};
}

RunNames my_names() {
  RunNames names = shipped_names();
  using O = HeightOptions;
  const auto height = window_part<O>(
      "A known height.",
      {{"states", Reference{Reference::To::provider, member<&O::states>}, "-", "Whose poses; empty: the first."},
       {"height", Real{member<&O::height>, -1e3, 1e3}, "m", "Of the body in world."},
       {"sigma", Real{member<&O::sigma>, 1e-6, 1e3}, "m", "How well it is known."},
       {"loss", Robust{member<&O::loss>}, "sigma", "Robust loss of it."}},
      make_height);
  EXPECT_TRUE(names.builders.add("height", height));
  EXPECT_TRUE(names.losses.add("saturating", {CustomLoss<Saturating>(1.0), "At most SCALE^2."}));
  return names;
}

constexpr const char* kConfig = R"(
task: sliding_window
executor: inline
providers: [{name: imu, noise_factor: 4}]
builders: [tracks, {name: height, height: 0, sigma: 0.001, loss: 'saturating:3'}]
)";

// ---- and what comes of it ----

// The height of the newest pose at the end of a short flight [m].
double fly(const RunConfig& config, const RunNames& names) {
  const SimulatedFlight flight({.rest_s = 1.5, .duration_s = 4.0});
  SensorSuite sensors{.has_imu = true, .imu = flight.noise, .cameras = 2, .rig = flight.rig};
  const auto made = AssembledWindow::make(config.window, names, sensors);
  EXPECT_TRUE(made) << made.error();
  AssembledWindow& window = **made;
  std::size_t next = 0;
  for (const SimulatedFlight::Frame& f : flight.frames) {
    while (next < flight.imu.size() && flight.imu[next].time <= f.time)
      EXPECT_TRUE(window.add(flight.imu[next++]).ok());
    window.update({f.time, f.features});
  }
  EXPECT_TRUE(window.has_begun()) << window.waiting_for();
  const State& newest = *window.window().states().timeline(window.body()).latest();
  EXPECT_EQ(newest.time, flight.frames.back().time);
  return window.window().graph().value(ImuProvider::pose(newest)).t[2];
}

// R9, W6: of a body that rises and a builder that says it does not. Without a loss it is believed; the user's loss
// lets go of it.
TEST(CustomParts, ABuilderAndALossOfOnesOwnAreNamedByAConfig) {
  const RunNames names = my_names();
  const auto reading = parse_run_config(kConfig, "mine.yaml", names);
  ASSERT_TRUE(reading.errors.empty()) << reading.errors[0];
  const auto& own = reading.config.window.builders[1].options.as<HeightOptions>();
  EXPECT_EQ(own.sigma, 0.001);
  EXPECT_EQ(own.loss.ops, &kLossOps<Saturating>);
  RunConfig alone = reading.config, believed = reading.config;
  alone.window.builders.pop_back();
  HeightOptions firm = own;
  firm.loss = Loss::none();
  believed.window.builders[1].options = AnyOptions(firm);
  const double free = fly(alone, names);
  EXPECT_GT(free, 0.2);
  EXPECT_LT(std::fabs(fly(believed, names)), 0.1);
  EXPECT_NEAR(fly(reading.config, names), free, 0.05);
}

// R9
TEST(CustomParts, AreRefusedWhereANameIsTakenOrUnknown) {
  RunNames names = my_names();
  EXPECT_EQ(names.builders.add("tracks", *names.builders.get("height")).error().message,
            "two of kind builder are named 'tracks'");
  const auto shipped = parse_run_config(kConfig, "mine.yaml");
  ASSERT_EQ(shipped.errors.size(), 1u);
  EXPECT_EQ(shipped.errors[0].text(),
            "mine.yaml:5: unknown builder 'height'; expected one of tracks, structureless, gnss");
}

}  // namespace
