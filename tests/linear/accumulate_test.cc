// The sums of JᵀJ and Jᵀr, block by block, against dense products: dimensions with a kernel and without one, rows in
// runs and one by one, one variable named twice, fixed variables, losses.
#include "oriel/linear/accumulate.h"

#include <gtest/gtest.h>

#include "linear/random_problem.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::RandomProblem;
using testing::System;

// The system as one dense matrix: kept with kept, and landmarks with themselves and with what sees them.
class DenseSystem {
 public:
  explicit DenseSystem(const System& system) : s_(system.structure), n_(system.numbers) {
    h_ = Eigen::MatrixXd::Zero(s_.dim(), s_.dim());
    const int kept = static_cast<int>(s_.kept().size());
    for (int i = 0; i < kept; ++i)
      for (int j = 0; j <= i; ++j)
        if (s_.factorization().has(i, j)) add_block(i, j);
    for (const LandmarkBlock& l : s_.landmarks()) add_landmark(l);
  }
  // Symmetric, by its lower half.
  Eigen::MatrixXd h() const { return h_.selfadjointView<Eigen::Lower>(); }

 private:
  void add_block(int i, int j) {
    const KeptBlock &a = s_.kept()[static_cast<std::size_t>(i)], &b = s_.kept()[static_cast<std::size_t>(j)];
    const BlockAddress at = s_.address(i, j);
    for (int c = 0; c < b.dim; ++c)
      for (int r = i == j ? c : 0; r < a.dim; ++r)
        h_(a.offset + r, b.offset + c) =
            n_.h.data()[at.offset + (at.transposed ? std::int64_t{r} * at.ld + c : std::int64_t{c} * at.ld + r)];
  }
  void add_landmark(const LandmarkBlock& l) {
    const double* data = n_.landmarks.data();
    for (int c = 0; c < l.dim; ++c) {
      for (int r = c; r < l.dim; ++r) h_(l.offset + r, l.offset + c) = data[l.v() + c * l.dim + r];
      int row = 0;
      for (int k = 0; k < l.neighbours; ++k) {
        const KeptBlock& b = s_.kept()[static_cast<std::size_t>(s_.neighbours()[l.first_neighbour + k])];
        if (s_.landmark_panel()) row = b.offset - s_.first_scalar();
        for (int r = 0; r < b.dim; ++r)
          h_(l.offset + c, b.offset + r) = data[l.w() + std::int64_t{c} * l.rows + row + r];
        row += b.dim;
      }
    }
  }
  const LinearStructure& s_;
  const LinearSystem& n_;
  Eigen::MatrixXd h_;
};

void expect_dense(RandomProblem& p, bool runs, const char* what) {
  ASSERT_TRUE(p.apply());
  System system(p.graph);
  std::size_t count = 0;
  for (std::size_t t = 0; t < system.structure.plan_count(); ++t) count += system.structure.plans()[t].runs.size();
  EXPECT_EQ(count > 0, runs) << what;
  const RandomProblem::Dense d = p.dense(system.structure);
  EXPECT_LE((DenseSystem(system).h() - d.h).norm(), 1e-12 * d.h.norm()) << what;
  EXPECT_LE((system.gradient() - d.g).norm(), 1e-12 * d.g.norm()) << what;
  const Eigen::Map<const Eigen::VectorXd> diagonal(system.numbers.diagonal.data(), system.structure.dim());
  EXPECT_LE((diagonal - d.h.diagonal()).norm(), 1e-12 * d.h.norm()) << what;
  EXPECT_NEAR(system.active.total, d.cost, 1e-12 * d.cost) << what;
}

Loss any_loss(RandomProblem& p) { return p.pick(3) == 0 ? Huber(0.8) : p.pick(3) == 0 ? Cauchy(1.2) : Loss::none(); }

// D rows over kept variables of dimensions A and B and a landmark of dimension L, in tables of a few kept variables
// (whose rows make runs) or of many (whose rows stand alone).
template <int D, int A, int B, int L>
void expect_landmark_products() {
  for (const bool runs : {true, false})
    for (unsigned seed = 1; seed <= 2; ++seed) {
      RandomProblem p(seed);
      const auto a = p.variables<VectorNd<A>>(runs ? 3 : 11);
      const auto b = p.variables<VectorNd<B>>(runs ? 3 : 11);
      const auto m = p.variables<Markd<L>>(25);
      p.fix(a[1]), p.fix(m[4]);
      for (int i = 0; i < (runs ? 170 : 90); ++i) {
        const Loss loss = any_loss(p);
        p.factor<D>(loss, p.any(a), p.any(b), p.any(m));
      }
      for (const auto id : a) p.factor<D>(id);
      for (const auto id : b) p.factor<D>(id);
      const std::string what = "rows " + std::to_string(D) + ", dimensions " + std::to_string(A) + " " +
                               std::to_string(B) + " " + std::to_string(L) + (runs ? ", runs" : ", rows alone");
      expect_dense(p, runs, what.c_str());
    }
}

TEST(Accumulate, EqualsDenseProductsOverKeptVariablesAndALandmark) {
  expect_landmark_products<1, 1, 2, 1>();
  expect_landmark_products<1, 3, 9, 2>();
  expect_landmark_products<2, 6, 6, 3>();
  expect_landmark_products<2, 6, 3, 1>();
  expect_landmark_products<2, 7, 2, 3>();
  expect_landmark_products<3, 9, 6, 3>();
  expect_landmark_products<4, 9, 9, 1>();
}

TEST(Accumulate, EqualsDenseProductsWhereADimensionHasNoKernel) {
  expect_landmark_products<2, 4, 5, 2>();
  expect_landmark_products<3, 8, 6, 3>();
}

TEST(Accumulate, EqualsDenseProductsOfOneKeptVariableAndALandmark) {
  for (const bool runs : {true, false}) {
    RandomProblem p(12);
    const auto x = p.variables<VectorNd<9>>(runs ? 6 : 40);
    const auto m = p.variables<Markd<3>>(30);
    for (int i = 0; i < 130; ++i) {
      const Loss loss = any_loss(p);
      p.factor<2>(loss, p.any(x), p.any(m));
    }
    for (const auto id : x) p.factor<9>(id);
    expect_dense(p, runs, runs ? "runs" : "rows alone");
  }
}

TEST(Accumulate, EqualsDenseProductsWithoutLandmarks) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    RandomProblem p(seed);
    const auto a = p.variables<VectorNd<6>>(9);
    const auto b = p.variables<VectorNd<3>>(9);
    const auto c = p.variables<VectorNd<4>>(5);
    p.fix(a[3]), p.fix(c[0]);
    for (int i = 0; i < 70; ++i) p.factor<6>(p.any(a), p.any(b), p.any(c));
    for (int i = 0; i < 30; ++i) p.factor<6>(any_loss(p), p.any(a), p.any(a));  // some name one variable twice
    for (int i = 0; i < 9; ++i) p.factor<3>(b[static_cast<std::size_t>(i)], b[static_cast<std::size_t>(i)]);
    p.prior({a[0], b[2], c[1]}, {6, 3, 4}, 10);
    expect_dense(p, false, "without landmarks");
  }
}

// More entries than stay in a first-level cache 512 bytes apart are copied side by side before they are multiplied.
TEST(Accumulate, EqualsDenseProductsOfLargeJacobians) {
  RandomProblem p(8);
  const auto a = p.variables<VectorNd<9>>(5);
  const auto b = p.variables<VectorNd<6>>(5);
  p.fix(a[2]);
  for (int i = 0; i < 21; ++i) p.factor<9>(any_loss(p), p.any(a), p.any(b));
  expect_dense(p, false, "9 × 15");
}

// Two landmarks of one factor: the second is kept, and is summed like any kept variable.
TEST(Accumulate, EqualsDenseProductsWhereALandmarkIsKept) {
  RandomProblem p(6);
  const auto x = p.variables<VectorNd<6>>(5);
  const auto m = p.variables<Markd<3>>(20);
  for (int i = 0; i < 80; ++i) p.factor<2>(p.any(x), p.any(m));
  for (int i = 0; i < 6; ++i) p.factor<3>(m[static_cast<std::size_t>(i)], m[static_cast<std::size_t>(i) + 6]);
  for (const auto id : x) p.factor<6>(id);
  expect_dense(p, false, "a landmark that is kept");
}

}  // namespace
}  // namespace oriel
