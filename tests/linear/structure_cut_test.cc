// A build that looks at the ends of columns alone, where places are taken again, fixed variables move, and tables get
// rows enough to be sorted: the bits of one that looks at everything.
#include <gtest/gtest.h>

#include <string_view>
#include <vector>

#include "oriel/linear/structure.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "tests/linear/step_of.h"

namespace oriel {
namespace {

// A pose and an anchor of a map.
struct Anchored {
  static constexpr std::string_view kName = "anchored/1";
  using Variables = Types<Pose2d, Velocity3d>;
  template <class S>
  Vec<S, 2> operator()(const Pose2<S>& pose, const Velocity3<S>& anchor) const {
    const auto d = pose.minus(Pose2<S>{});
    Vec<S, 2> r;
    r[0] = d[0] - anchor.v[0], r[1] = d[1] - anchor.v[1];
    return r;
  }
};

class StructureCut : public ::testing::Test {
 protected:
  // The structure that has followed so far, against one that is built from nothing.
  void expect_same_bits(const char* when) {
    EliminationOrder same = order_;
    LinearStructure fresh;
    ASSERT_TRUE(kept_.build(graph_, counts_as_large(), order_));
    ASSERT_TRUE(fresh.build(graph_, counts_as_large(), same));
    ASSERT_EQ(order_, same) << when;
    ASSERT_TRUE(kept_.pattern().same_as(fresh.pattern())) << when;
    ASSERT_EQ(kept_.kept().size(), fresh.kept().size());
    for (std::size_t i = 0; i < fresh.kept().size(); ++i) {
      ASSERT_EQ(kept_.kept()[i].pool, fresh.kept()[i].pool) << when;
      ASSERT_EQ(kept_.kept()[i].dense, fresh.kept()[i].dense) << when;
    }
    ASSERT_EQ(kept_.plan_count(), fresh.plan_count());
    for (std::size_t t = 0; t < fresh.plan_count(); ++t)
      ASSERT_EQ(kept_.plans()[t].dense, fresh.plans()[t].dense) << when;
    ASSERT_EQ(step_of(graph_, kept_), step_of(graph_, fresh)) << when;
  }
  template <class Fill>
  void apply(Fill fill) {
    GraphEdit edit = graph_.edit();
    fill(edit);
    ASSERT_TRUE(graph_.apply(edit));
  }
  template <class Pose>
  void come(GraphEdit& edit, std::vector<VariableId<Pose>>& all) {
    Vec<double, Pose::kDim> away{};
    away[0] = 0.01 * static_cast<double>(all.size());
    all.push_back(edit.add(Pose{}.plus(away)));
    edit.add(Prior{Pose{}}, Sigma(1.0), all.back());
    if (all.size() > 1) edit.add(Between<Pose>{}, Sigma(0.3), all[all.size() - 2], all.back());
  }

  Graph graph_;
  LinearStructure kept_;
  EliminationOrder order_;
  std::vector<VariableId<Pose2d>> flat_;
  std::vector<VariableId<Pose3d>> deep_;
};

// L10: the columns of the few are compacted, so that the new one has the place, and its factors the rows, of one that
// is gone; but not its index, as another came before.
TEST_F(StructureCut, TellsANewFactorFromOneWhoseRowAndPlacesItHas) {
  apply([this](GraphEdit& edit) {
    come(edit, deep_), come(edit, deep_);
    for (int i = 0; i < 200; ++i) come(edit, flat_);
    come(edit, deep_);
  });
  expect_same_bits("at first");
  apply([this](GraphEdit& edit) { edit.remove(deep_.back()), deep_.pop_back(); });
  apply([this](GraphEdit& edit) { come(edit, flat_), come(edit, deep_); });
  expect_same_bits("when it came");
}

// L10
TEST_F(StructureCut, FreesAVariableThatIsOlderThanAllThatAreFree) {
  apply([this](GraphEdit& edit) {
    for (int i = 0; i < 600; ++i) come(edit, deep_), edit.fix(deep_.back());
    for (int i = 0; i < 30; ++i) come(edit, flat_);
  });
  expect_same_bits("at first");
  apply([this](GraphEdit& edit) { edit.fix(deep_.back(), false); });
  expect_same_bits("when it is free");
}

// L10: rows that stand where they stood name another place.
TEST_F(StructureCut, FindsFixedVariablesThatHaveMoved) {
  std::vector<VariableId<Velocity3d>> map;
  apply([&](GraphEdit& edit) {
    for (int i = 0; i < 1000; ++i) {
      Velocity3d anchor;
      anchor.v[0] = 0.001 * i;
      map.push_back(edit.add(anchor));
      edit.fix(map.back());
    }
    for (std::size_t i = 0; i < 60; ++i) {
      come(edit, flat_);
      edit.add(Anchored{}, Sigma(1.0), flat_[i], map[i == 7 ? 999 : i]);
    }
  });
  expect_same_bits("at first");
  for (std::size_t last = 998; last > 700; last -= 20) {
    apply([&](GraphEdit& edit) {
      for (std::size_t i = 0; i < 20; ++i) edit.remove(map[last - i]);
    });
    expect_same_bits("while the map goes");
  }
  EXPECT_LT(graph_.find_pool(kVariableOps<Velocity3d>.key)->extent(), 800u) << "no column was compacted";
}

// L10: rows that were in turn are sorted, while the newest variable moves.
TEST_F(StructureCut, SortsATableThatHasGrownWhileAVariableMoved) {
  constexpr std::size_t kPoses = 4000;
  apply([this](GraphEdit& edit) {
    for (std::size_t i = 0; i < kPoses; ++i) deep_.push_back(edit.add(Pose3d{}));
    for (const auto x : deep_) edit.add(Prior{Pose3d{}}, Sigma(1.0), x);
    edit.add(Between<Pose3d>{}, Sigma(0.3), deep_.front(), deep_.back());
    for (std::size_t i = 1; i < 2900; ++i) edit.add(Between<Pose3d>{}, Sigma(0.3), deep_[i - 1], deep_[i]);
  });
  expect_same_bits("at first");
  std::size_t last = kPoses - 2;
  for (int k = 1; k <= 17; ++k) {
    apply([&](GraphEdit& edit) {
      for (int i = 0; i < 60; ++i) edit.remove(deep_[last--]);
      for (std::size_t i = 0; k == 17 && i < 900; ++i) edit.add(Between<Pose3d>{}, Sigma(0.3), deep_[i], deep_[i + 50]);
    });
    expect_same_bits("while poses go");
  }
  EXPECT_LT(graph_.pools()[0]->extent(), 3000u) << "no column was compacted";
  EXPECT_FALSE(kept_.plans()[0].slices.empty() && kept_.plans()[1].slices.empty()) << "no table was sorted";
}

}  // namespace
}  // namespace oriel
