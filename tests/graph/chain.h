// A small graph that the tests of edits start from.
#pragma once
#include <gtest/gtest.h>

#include <cstring>

#include "oriel/graph/graph.h"
#include "oriel/manifold/se3.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"

namespace oriel::testing {

inline Pose3d pose_at(double x) {
  Vec6d d = Vec6d::zero();
  d[3] = x;
  return Pose3d{}.plus(d);
}

// A prior over one pose at `x`: 6 rows, R = I.
inline LinearPrior unit_prior(VariableId<Pose3d> id, const Pose3d& x) {
  LinearPrior p;
  p.variables = {id};
  p.estimates.resize(estimate_doubles(kVariableOps<Pose3d>));
  std::memcpy(p.estimates.data(), &x, sizeof(x));
  p.rows = p.cols = 6;
  p.d.assign(6, 0.0);
  p.R.assign(36, 0.0);
  for (std::size_t i = 0; i < 6; ++i) p.R[i * 7] = 1.0;
  return p;
}

// Three poses in a chain, a point, two priors of the two kinds.
struct Chain {
  Graph graph;
  VariableId<Pose3d> a, b, c, gone;
  FactorId between_ab, between_bc, prior_a, linear_b, gone_factor;

  Chain() {
    GraphEdit edit = graph.edit();
    a = edit.add(pose_at(0.0), Label("a"));
    b = edit.add(pose_at(1.0));
    c = edit.add(pose_at(2.0));
    gone = edit.add(pose_at(9.0));
    prior_a = edit.add(Prior{pose_at(0.0)}, Sigma(0.1), a);
    between_ab = edit.add(Between{pose_at(1.0)}, Sigma(0.1), a, b);
    between_bc = edit.add(Between{pose_at(1.0)}, Sigma(0.1), Huber(1.0), b, c);
    gone_factor = edit.add(Prior{pose_at(9.0)}, Sigma(0.1), gone);
    linear_b = edit.add(unit_prior(b, pose_at(1.0)));
    EXPECT_TRUE(graph.apply(edit));
    GraphEdit removal = graph.edit();
    removal.remove(gone);
    EXPECT_TRUE(graph.apply(removal));
  }
};

}  // namespace oriel::testing
