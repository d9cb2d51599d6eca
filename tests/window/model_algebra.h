// Dense rows and priors over named unknowns: the algebra of the window's model.
#pragma once
#include <Eigen/Dense>
#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "linear_world.h"
#include "oriel/graph/ids.h"

namespace oriel::linear_world {

struct ModelRow {
  std::vector<DenseTruth::Term> terms;
  Eigen::VectorXd z;
  double sigma = 1.0;
  FactorId factor;  // in the window; of a first state's prior none

  bool touches(const Unknown& u) const {
    return std::any_of(terms.begin(), terms.end(), [&](const auto& t) { return t.of == u; });
  }
  bool touches_any(const std::set<Unknown>& some) const {
    return std::any_of(terms.begin(), terms.end(), [&](const auto& t) { return some.count(t.of) > 0; });
  }
};

struct ModelPrior {  // d = R x
  std::vector<Unknown> of;
  Eigen::MatrixXd R;
  Eigen::VectorXd d;
  bool names(const Unknown& u) const { return std::find(of.begin(), of.end(), u) != of.end(); }
  bool names_any(const std::set<Unknown>& some) const {
    return std::any_of(of.begin(), of.end(), [&](const Unknown& u) { return some.count(u) > 0; });
  }
  Eigen::Index first_column(const Unknown& u) const {
    Eigen::Index column = 0;
    for (auto at = of.begin(); at != of.end() && *at != u; ++at) column += at->dim();
    return column;
  }
  auto columns(const Unknown& u) { return R.middleCols(first_column(u), u.dim()); }
  Eigen::MatrixXd columns(const Unknown& u) const { return R.middleCols(first_column(u), u.dim()); }
};

// What is gone, given what stayed then: d = R [gone; given]. As many rows as scalars of it are determined.
struct ModelConditional {
  std::vector<Unknown> gone, given;
  Eigen::MatrixXd R;
  Eigen::VectorXd d;
};

namespace algebra {

constexpr double kNegligible = 1e-11;  // of a pivot, beside the largest

// The rows, whitened, and the priors below them.
inline std::pair<Eigen::MatrixXd, Eigen::VectorXd> stack(const std::vector<ModelRow>& rows,
                                                         const std::vector<ModelPrior>& priors,
                                                         const std::map<Unknown, int>& at, int n) {
  Eigen::Index m = 0, i = 0;
  for (const ModelRow& r : rows) m += r.z.size();
  for (const ModelPrior& p : priors) m += p.d.size();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(std::max<Eigen::Index>(m, n), n);  // QR wants as many rows as columns
  Eigen::VectorXd b = Eigen::VectorXd::Zero(A.rows());
  for (const ModelRow& r : rows) {
    for (const auto& t : r.terms)
      for (int d = 0; d < r.z.size(); ++d) A(i + d, at.at(t.of) + (t.scalar >= 0 ? t.scalar : d)) += t.sign / r.sigma;
    b.segment(i, r.z.size()) = r.z / r.sigma;
    i += r.z.size();
  }
  for (const ModelPrior& p : priors) {
    int column = 0;
    for (const Unknown& u : p.of) {
      A.block(i, at.at(u), p.R.rows(), u.dim()) = p.R.middleCols(column, u.dim());
      column += u.dim();
    }
    b.segment(i, p.d.size()) = p.d;
    i += p.d.size();
  }
  return {A, b};
}

// Its columns: A P = Q [R S; 0 0], so that A P [-R⁻¹ S; I] = 0. Some of its entries are of the size of 1.
inline Eigen::MatrixXd null_space(const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& qr) {
  const Eigen::Index n = qr.cols(), r = qr.rank();
  Eigen::MatrixXd N = Eigen::MatrixXd::Identity(n, n).rightCols(n - r);
  const Eigen::MatrixXd S = qr.matrixR().topRightCorner(r, n - r);
  N.topRows(r) = -qr.matrixR().topLeftCorner(r, r).triangularView<Eigen::Upper>().solve(S);
  return qr.colsPermutation() * N;
}

// The solution that is zero in the unknowns beyond the rank. (Eigen's own divides by the pivots that are rounding.)
inline Eigen::VectorXd solved(const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& qr, const Eigen::VectorXd& b) {
  const Eigen::Index r = qr.rank();
  const Eigen::VectorXd c = qr.householderQ().transpose() * b;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(qr.cols());
  x.head(r) = qr.matrixR().topLeftCorner(r, r).triangularView<Eigen::Upper>().solve(c.head(r));
  return qr.colsPermutation() * x;
}

inline ModelPrior prior_of(const ModelRow& row) {
  ModelPrior prior;
  std::map<Unknown, int> at;
  int n = 0;
  for (const auto& t : row.terms)
    if (at.emplace(t.of, n).second) prior.of.push_back(t.of), n += t.of.dim();
  const auto [A, b] = stack({row}, {}, at, n);
  prior.R = A.topRows(row.z.size()), prior.d = b.head(row.z.size());
  return prior;
}

// Takes out, from some column on, the unknowns in whose columns nothing is larger than that.
inline void prune(std::vector<Unknown>& of, Eigen::MatrixXd& R, int first, double least) {
  int to = first, from = first;
  std::vector<Unknown> kept;
  for (const Unknown& u : of) {
    const int dim = u.dim();
    if (R.rows() > 0 && R.middleCols(from, dim).cwiseAbs().maxCoeff() > least) {
      R.middleCols(to, dim) = R.middleCols(from, dim).eval();
      to += dim;
      kept.push_back(u);
    }
    from += dim;
  }
  R.conservativeResize(R.rows(), to);
  of = std::move(kept);
}

struct Elimination {
  ModelPrior rest;
  ModelConditional known;
};

// Rows and priors split into what they say of the leaving ones given the others, and what they say of the others: the
// leaving columns first; what is below their rows after reflections. Pivots up to `least` are rounding; 0: by the rank.
inline Elimination eliminate(const std::set<Unknown>& leaving, const std::vector<ModelRow>& rows,
                             const std::vector<ModelPrior>& priors, double least = 0.0) {
  std::map<Unknown, int> at;
  int n = 0;
  Elimination out;
  for (const Unknown& u : leaving) at[u] = n, n += u.dim(), out.known.gone.push_back(u);
  const int gone = n;
  ModelPrior& rest = out.rest;
  auto stays = [&](const Unknown& u) {
    if (!at.emplace(u, n).second) return;
    rest.of.push_back(u);
    n += u.dim();
  };
  for (const ModelRow& r : rows)
    for (const auto& t : r.terms) stays(t.of);
  for (const ModelPrior& p : priors)
    for (const Unknown& u : p.of) stays(u);
  out.known.given = rest.of;
  const int kept = n - gone;
  const auto [A, b] = stack(rows, priors, at, n);
  Eigen::MatrixXd right(A.rows(), kept + 1);
  right << A.rightCols(kept), b;
  Eigen::Index rank = 0;
  if (gone > 0) {
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A.leftCols(gone));
    right.applyOnTheLeft(qr.householderQ().transpose());
    rank = least > 0.0 ? (qr.matrixR().diagonal().array().abs() > least).count() : qr.rank();
    out.known.R.resize(rank, n);
    out.known.R << Eigen::MatrixXd(qr.matrixR().topRows(rank).triangularView<Eigen::Upper>()) *
                       qr.colsPermutation().transpose(),
        right.topLeftCorner(rank, kept);
    out.known.d = right.col(kept).head(rank);
  }
  const Eigen::Index rows_left = right.rows() - rank;
  if (kept == 0) return out;
  rest.R = right.bottomLeftCorner(rows_left, kept);
  rest.d = right.col(kept).tail(rows_left);
  if (rows_left > kept) {  // no more rows than a triangle has
    const Eigen::HouseholderQR<Eigen::MatrixXd> triangle(rest.R);
    rest.d = (triangle.householderQ().transpose() * rest.d).head(kept).eval();
    rest.R = Eigen::MatrixXd(triangle.matrixQR().topRows(kept).triangularView<Eigen::Upper>());
  }
  return out;
}
inline ModelPrior eliminated(const std::set<Unknown>& leaving, const std::vector<ModelRow>& rows,
                             const std::vector<ModelPrior>& priors, double least = 0.0) {
  return eliminate(leaving, rows, priors, least).rest;
}

// What leaves together and shares no unknown makes priors apart (M11). Later that matters: of priors that know a
// variable which is removed, each keeps what it alone says of others (V6), and not what only all of them together
// would.
struct Part {
  std::set<Unknown> of;
  std::vector<ModelRow> rows;
  std::vector<ModelPrior> priors;
};
inline void join(std::vector<Part>& all, Part whole) {
  for (std::size_t k = all.size(); k-- > 0;) {
    const Part& p = all[k];
    if (std::none_of(p.of.begin(), p.of.end(), [&](const Unknown& u) { return whole.of.count(u) > 0; })) continue;
    whole.of.insert(p.of.begin(), p.of.end());
    whole.rows.insert(whole.rows.end(), p.rows.begin(), p.rows.end());
    whole.priors.insert(whole.priors.end(), p.priors.begin(), p.priors.end());
    all.erase(all.begin() + static_cast<std::ptrdiff_t>(k));
  }
  all.push_back(std::move(whole));
}
inline std::vector<Part> parts(const std::vector<ModelRow>& rows, const std::vector<ModelPrior>& priors) {
  std::vector<Part> all;
  for (const ModelRow& r : rows) {
    Part alone;
    for (const auto& t : r.terms) {
      alone.of.insert(t.of);
      // The motion of a level and of its offset is one factor.
      if (r.terms.size() == 2 && r.terms[0].of.what == r.terms[1].of.what)
        if (t.of.what == What::level || t.of.what == What::offset)
          alone.of.insert({What::level, t.of.number}), alone.of.insert({What::offset, t.of.number});
    }
    alone.rows.push_back(r);
    join(all, std::move(alone));
  }
  for (const ModelPrior& p : priors) join(all, {{p.of.begin(), p.of.end()}, {}, {p}});
  return all;
}

// Of the information of all of some priors, H = RᵀR and g = Rᵀd, from that of others: the largest of any scalar,
// beside the largest there is.
inline double difference(const std::vector<ModelPrior>& some, const std::vector<ModelPrior>& others) {
  std::map<Unknown, int> at;
  int n = 0;
  for (const auto* priors : {&some, &others})
    for (const ModelPrior& p : *priors)
      for (const Unknown& u : p.of)
        if (at.emplace(u, n).second) n += u.dim();
  if (n == 0) return 0.0;
  const auto [A, a] = stack({}, some, at, n);
  const auto [B, b] = stack({}, others, at, n);
  const Eigen::MatrixXd H = A.transpose() * A;
  const Eigen::VectorXd g = A.transpose() * a;
  const double by_matrix = (B.transpose() * B - H).cwiseAbs().maxCoeff() / (1.0 + H.cwiseAbs().maxCoeff());
  const double by_vector = (B.transpose() * b - g).cwiseAbs().maxCoeff() / (1.0 + g.cwiseAbs().maxCoeff());
  return std::max(by_matrix, by_vector);
}

}  // namespace algebra
}  // namespace oriel::linear_world
