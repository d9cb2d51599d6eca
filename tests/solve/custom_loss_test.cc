// A user's robust loss: a struct with a name and a function of (scale, squared norm).
#include <gtest/gtest.h>

#include <cmath>

#include "oriel/graph/fingerprint.h"
#include "oriel/graph/wire.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace {

using namespace oriel;  // NOLINT(google-build-using-namespace): as a user would write it
using Scalar = VectorNd<1>;

struct Saturating {  // ρ(s) = s / (1 + s/c²): at most c², however far the measurement is off
  static constexpr std::string_view kName = "example.geman_mcclure/1";
  static LossValue<double> evaluate(double c, double s) {
    const double u = 1.0 + s / (c * c);
    return {s / u, 1.0 / (u * u)};
  }
};

struct Quadratic {  // no loss at all, by the user's way
  static constexpr std::string_view kName = "example.quadratic/1";
  static LossValue<double> evaluate(double, double s) { return {s, 1.0}; }
};

// Counts what it is asked and could not answer: the square of a residual that is not a number.
struct Counting {
  static constexpr std::string_view kName = "example.counting/1";
  static inline int calls = 0, without_number = 0;
  static LossValue<double> evaluate(double, double s) {
    ++calls;
    if (!std::isfinite(s)) ++without_number;
    return {s, 1.0};
  }
};

struct Root {  // √x - 1, not valid where x is negative
  static constexpr std::string_view kName = "example.root/1";
  using Variables = Types<Scalar>;
  template <class S>
  std::optional<S> operator()(const VectorN<S, 1>& x) const {
    using std::sqrt;
    if (x.v[0] < S(0.0)) return std::nullopt;
    return sqrt(x.v[0]) - S(1.0);
  }
};

// Measurements of one scalar about 1, one of them far off.
VariableId<Scalar> add_measurements(Graph& graph, const Loss& loss) {
  GraphEdit edit = graph.edit();
  const auto x = edit.add(Scalar{{{1.3}}});
  for (const double m : {0.9, 1.0, 1.1, 50.0}) edit.add(Prior{Scalar{{{m}}}}, Sigma(0.1), loss, x);
  const auto ok = graph.apply(edit);
  EXPECT_TRUE(ok) << ok.error();
  return x;
}

TEST(CustomLoss, KeepsAnOutlierFromPulling) {  // V9
  Graph graph;
  const auto x = add_measurements(graph, CustomLoss<Saturating>(3.0));
  NativeEngine engine(graph);
  const Summary summary = engine.solve();
  EXPECT_TRUE(summary.converged()) << summary;
  EXPECT_NEAR(graph.value(x).v[0], 1.0, 1e-2);
  double cost = 0.0, slope = 0.0;  // ½Σρ, and Σρ'(r) r / σ by hand
  for (const double m : {0.9, 1.0, 1.1, 50.0}) {
    const double r = (graph.value(x).v[0] - m) / 0.1, u = 1.0 + r * r / 9.0;
    cost += 0.5 * r * r / u, slope += r / (u * u);
  }
  EXPECT_NEAR(summary.final_cost, cost, 1e-12 * cost);
  EXPECT_NEAR(slope, 0.0, 1e-3);
}

TEST(CustomLoss, GivesWhatABuiltInOneGivesForTheSameFunction) {  // V9
  Graph custom, built_in;
  const auto x = add_measurements(custom, CustomLoss<Quadratic>(1.0));
  const auto y = add_measurements(built_in, Loss::none());
  NativeEngine a(custom), b(built_in);
  EXPECT_EQ(a.solve().final_cost, b.solve().final_cost);
  EXPECT_EQ(custom.value(x).v[0], built_in.value(y).v[0]);
  EXPECT_NE(fingerprint(custom), fingerprint(built_in));  // what the losses are is part of a graph
}

// What a journal or a worker is sent holds the loss by name; a reader must know it, as it must know types.
TEST(CustomLoss, TravelsByItsNameToReadersThatKnowIt) {  // V9
  Graph graph;
  add_measurements(graph, CustomLoss<Saturating>(3.0));
  GraphEdit net;
  graph.collect(graph.subscribe(), net);
  Bytes bytes;
  append_edit(bytes, net);
  TypeList types;
  types.factor<Prior<Scalar>, IsotropicNoise>();
  Graph replica;
  GraphEdit read = replica.edit();
  const auto message = read_message(bytes);
  ASSERT_TRUE(message);
  const auto unknown = read_edit(*message, types, replica, read);
  ASSERT_FALSE(unknown.ok());
  EXPECT_EQ(unknown.error().code, ErrorCode::not_found);
  EXPECT_NE(unknown.error().text().find("example.geman_mcclure/1"), std::string::npos) << unknown.error();
  types.loss<Saturating>();
  ASSERT_TRUE(read_edit(*message, types, replica, read));
  ASSERT_TRUE(replica.apply(read));
  EXPECT_EQ(fingerprint(replica), fingerprint(graph));
  NativeEngine a(graph), b(replica);
  EXPECT_EQ(a.solve().final_cost, b.solve().final_cost);
}

TEST(CustomLoss, IsRefusedWithoutAFunctionOrAScale) {  // V5, V9
  for (const Loss& bad : {Loss{LossKind::custom, 1.0, nullptr}, CustomLoss<Quadratic>(0.0),
                          Loss{LossKind::huber, 1.0, &kLossOps<Quadratic>}}) {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto x = edit.add(Scalar{});
    edit.add(Prior{Scalar{}}, Sigma(0.1), bad, x);
    const auto result = graph.apply(edit);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::bad_input);
    EXPECT_NE(result.error().text().find("loss"), std::string::npos);
    EXPECT_EQ(graph.variable_count(), 0u);
  }
}

// A user's function need not expect what a factor leaves behind that is not valid, nor the lanes of a batch without
// one.
TEST(CustomLoss, IsAskedOfValidFactorsAlone) {  // V8, V9
  Graph graph;
  GraphEdit edit = graph.edit();
  for (const double start : {2.0, -1.0, 3.0}) {
    const auto x = edit.add(Scalar{{{start}}});
    edit.add(Root{}, Sigma(1.0), CustomLoss<Counting>(1.0), x);
    edit.add(Prior{Scalar{{{start}}}}, Sigma(1.0), x);
  }
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  Counting::calls = Counting::without_number = 0;
  const double cost = engine.cost();
  EXPECT_EQ(Counting::calls, 2);
  const Summary s = engine.solve();
  EXPECT_EQ(s.invalid_factors, 1);
  EXPECT_EQ(s.initial_cost, cost);
  EXPECT_GT(Counting::calls, 2);
  EXPECT_EQ(Counting::without_number, 0);
}

}  // namespace
