// `oriel nees`: what it says; whether the window is consistent is tested in tests/evaluate.
#include "command_runner.h"

namespace oriel::apps {
namespace {

using NeesCommand = CommandTest;

TEST_F(NeesCommand, ReportsBothVariantsWithTheirIntervals) {
  const CommandResult r = oriel("nees --runs 3 --seconds 4 --tracks 15 --json -");
  ASSERT_NE(r.exit_code, 2) << r.err;
  const auto o = r.json();
  ASSERT_TRUE(o.is_object()) << r.out;
  ASSERT_EQ(o["variants"].size(), 2u);
  EXPECT_EQ(o["variants"][0]["first_estimates"], true);
  EXPECT_EQ(o["variants"][1]["first_estimates"], false);
  for (const auto& variant : o["variants"]) {
    EXPECT_EQ(variant["times_s"].size(), 4u);
    ASSERT_EQ(variant["nees"].size(), 5u);
    for (const auto& q : variant["nees"]) {
      EXPECT_EQ(q["epochs"].size(), 4u);
      EXPECT_GT(q["mean"].get<double>(), 0.0);
      EXPECT_LT(q["interval_end"][0].get<double>(), q["dof"].get<double>());
      EXPECT_GT(q["interval_end"][1].get<double>(), q["dof"].get<double>());
    }
  }
  EXPECT_EQ(o["variants"][0]["nees"][0]["of"], "pose");
  EXPECT_EQ(o["variants"][0]["nees"][1]["of"], "velocity");
}

TEST_F(NeesCommand, RefusesBadOptionsWithOneLine) {
  for (const std::string arguments : {"--runs 1", "--seconds 0", "--landmarks balloon", "--json /nowhere/x.json"}) {
    const CommandResult r = oriel("nees " + arguments);
    EXPECT_EQ(r.exit_code, 2) << arguments;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_TRUE(r.out.empty());
  }
}

}  // namespace
}  // namespace oriel::apps
