// A user's struct as a variable: a temperature in kelvin, stepped by its logarithm so that it stays positive.
#include <gtest/gtest.h>

#include <cmath>

#include "oriel/manifold/laws.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace {

using namespace oriel;  // NOLINT(google-build-using-namespace): as a user would write it

struct Temperature {
  static constexpr std::string_view kName = "example.temperature/1";
  static constexpr int kDim = 1;
  static constexpr std::array<std::string_view, 1> kTangentNames = {"log temperature [1]"};
  double kelvin = 293.0;
  Temperature plus(const Vec1d& d) const { return {kelvin * std::exp(d[0])}; }
  Vec1d minus(const Temperature& x) const { return {std::log(kelvin / x.kelvin)}; }
};
static_assert(Manifold<Temperature>);

struct Radiation {  // [W/m²], Stefan–Boltzmann; a residual between a user's types, without dual numbers
  static constexpr std::string_view kName = "example.radiation/1";
  using Variables = Types<Temperature>;
  double power = 0.0;
  double operator()(const Temperature& t) const { return 5.67e-8 * std::pow(t.kelvin, 4) - power; }
};

TEST(CustomVariable, IsAPlainStructAndNothingElse) {  // V9
  Graph graph;
  GraphEdit edit = graph.edit();
  const VariableId<Temperature> t = edit.add(Temperature{250.0}, Label("wall"));
  edit.add(Radiation{5.67e-8 * std::pow(300.0, 4)}, Sigma(0.1), t);
  edit.add(Prior{Temperature{300.0}}, Sigma(0.01), t);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary summary = engine.solve();
  EXPECT_TRUE(summary.converged()) << summary;
  EXPECT_NEAR(graph.value(t).kelvin, 300.0, 1e-6);
  EXPECT_EQ(graph.count<Temperature>(), 1u);
}

TEST(CustomVariable, IsNamedWithItsUnitsWhereNothingDeterminesIt) {  // V9, L6
  Graph graph;
  GraphEdit edit = graph.edit();
  edit.add(Temperature{}, Label("roof"));
  const auto wall = edit.add(Temperature{}, Label("wall"));
  edit.add(Prior{Temperature{280.0}}, Sigma(0.01), wall);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary summary = engine.solve();
  ASSERT_EQ(summary.undetermined.size(), 1u);
  EXPECT_EQ(describe(graph, summary.undetermined[0]), "example.temperature/1 'roof': log temperature [1]");
}

}  // namespace
