// A window as a mathematician would keep it: states and landmarks by what they are, a list of rows, dense priors in
// square-root form. It shares no code with the library's window, and is what that is compared with after any operation.
#pragma once
#include <Eigen/Dense>
#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "linear_window.h"

namespace oriel::linear_world {

class WindowModel {
 public:
  struct Row {
    std::vector<DenseTruth::Term> terms;
    Eigen::VectorXd z;
    double sigma = 1.0;
    FactorId factor;  // in the window; of a first state's prior none
  };
  struct Node {
    bool severed = false;
  };
  using Chain = std::map<Time, Node>;
  using Values = std::map<Unknown, Eigen::VectorXd>;
  struct Prior {  // d = R x
    std::vector<Unknown> of;
    Eigen::MatrixXd R;
    Eigen::VectorXd d;
    bool names(const Unknown& u) const { return std::find(of.begin(), of.end(), u) != of.end(); }
  };

  Chain chains[2];  // positions, levels
  Increments<2> moved;
  Increments<4> levelled;
  std::set<int> landmarks;
  std::string wrong;  // what the window did that it may not do

  static std::vector<Unknown> unknowns(int chain, Time t) {
    if (chain == 0) return {{What::position, t.ns}};
    return {{What::level, t.ns}, {What::offset, t.ns}};
  }

  // ---- what happens ----
  void enter(const MeasuredGroup& group, const std::vector<FactorId>& factors) {
    std::set<std::pair<Time, int>> named;  // in the order of time
    for (const Measured& m : group) {
      if (m.bad) wrong = "a NaN entered";
      for (const auto& [chain, time] : times(m)) named.emplace(time, chain);
    }
    for (const auto& [time, chain] : named) add_state(chain, time);
    for (std::size_t k = 0; k < group.size(); ++k) {
      Row row = row_of(group[k]);
      row.factor = factors[k];
      for (const auto& t : row.terms)
        if (t.of.what == What::landmark) landmarks.insert(static_cast<int>(t.of.number));
      rows_.push_back(std::move(row));
    }
  }
  void add_state(int chain, Time time) {
    Chain& line = chains[chain];
    if (line.count(time) > 0) return;
    const auto after = line.upper_bound(time);
    if (line.empty()) {
      for (const Unknown& u : unknowns(chain, time))
        rows_.push_back({{{u}}, Eigen::VectorXd::Zero(u.dim()), kFirstSigma, {}});
    } else if (after == line.begin()) {
      wrong = "a state came before the first: " + std::to_string(time.ns / 1000000) + " [ms] of chain " +
              std::to_string(chain) + ", which begins at " + std::to_string(line.begin()->first.ns / 1000000);
    } else if (after != line.end() && after->second.severed) {
      wrong = "a state came between two whose motion is in the prior";
    }
    line[time] = {};
  }
  void add_row(Row row) { rows_.push_back(std::move(row)); }
  void remove_factor(FactorId id) {
    std::erase_if(rows_, [&](const Row& r) { return r.factor == id; });
  }
  // A landmark or state leaves with its rows; each prior keeps what it alone says of others.
  void remove(const Unknown& u) {
    std::erase_if(rows_, [&](const Row& r) { return touches(r, u); });
    if (u.what == What::landmark) landmarks.erase(static_cast<int>(u.number));
    for (std::size_t k = priors_.size(); k-- > 0;) {
      if (!priors_[k].names(u)) continue;
      const Prior whole = std::move(priors_[k]);
      priors_.erase(priors_.begin() + static_cast<std::ptrdiff_t>(k));
      keep(eliminated({u}, {}, {whole}));
    }
  }
  void remove_state(int chain, Time time) {
    for (const Unknown& u : unknowns(chain, time)) remove(u);
    Chain& line = chains[chain];
    const bool severed = line[time].severed;
    const auto next = line.erase(line.find(time));
    if (next != line.end()) next->second.severed |= severed;
  }
  // States of both kinds, and landmarks that they alone have seen, leave; what they knew stays.
  void marginalize(const std::vector<std::pair<int, Time>>& states, const std::vector<int>& gone_landmarks) {
    std::set<Unknown> leaving;
    for (const auto& [chain, time] : states)
      for (const Unknown& u : unknowns(chain, time)) leaving.insert(u);
    for (const int l : gone_landmarks) leaving.insert({What::landmark, l});
    std::vector<Row> absorbed;
    for (const Row& r : all_rows())
      if (std::any_of(leaving.begin(), leaving.end(), [&](const Unknown& u) { return touches(r, u); })) {
        absorbed.push_back(r);
        for (const auto& t : r.terms)
          if (r.terms.size() > 1 && leaving.count(t.of) == 0 && names_landmark(r, gone_landmarks))
            wrong = "a landmark left that a staying state sees";
      }
    std::erase_if(rows_, [&](const Row& r) {
      return std::any_of(leaving.begin(), leaving.end(), [&](const Unknown& u) { return touches(r, u); });
    });
    for (const auto& [chain, time] : states) {
      const auto next = chains[chain].erase(chains[chain].find(time));
      if (next != chains[chain].end()) next->second.severed = true;
    }
    for (const int l : gone_landmarks) landmarks.erase(l);
    std::vector<Prior> used;
    std::erase_if(priors_, [&](const Prior& p) {
      const bool touched = std::any_of(leaving.begin(), leaving.end(), [&](const Unknown& u) { return p.names(u); });
      if (touched) used.push_back(p);
      return touched;
    });
    for (const Part& part : parts(absorbed, used)) {
      std::set<Unknown> gone;
      for (const Unknown& u : leaving)
        if (part.of.count(u) > 0) gone.insert(u);
      keep(eliminated(gone, part.rows, part.priors));
    }
  }
  void begin_anew() {
    for (Chain& c : chains) c.clear();
    rows_.clear();
    landmarks.clear();
    priors_.clear();
  }

  // ---- what is known ----
  // Rows of no landmark but that one, and of states of a set, are all that a landmark has.
  bool sees_alone(int landmark, const Unknown& state) const {
    for (const Row& r : rows_)
      if (touches(r, {What::landmark, landmark}))
        for (const auto& t : r.terms)
          if (t.of.what != What::landmark && !(t.of == state)) return false;
    return std::none_of(priors_.begin(), priors_.end(), [&](const Prior& p) {
      return p.names({What::landmark, landmark});
    });
  }
  const std::vector<Row>& rows() const { return rows_; }
  const std::vector<Prior>& priors() const { return priors_; }
  // Of what any row or prior names, but for what they leave undetermined.
  Values solve() const {
    std::map<Unknown, int> at;
    int n = 0;
    auto place = [&](const Unknown& u) {
      if (at.emplace(u, n).second) n += u.dim();
    };
    const std::vector<Row> rows = all_rows();
    for (const Row& r : rows)
      for (const auto& t : r.terms) place(t.of);
    for (const Prior& p : priors_)
      for (const Unknown& u : p.of) place(u);
    const auto [A, b] = stack(rows, priors_, at, n);
    Values out;
    if (n == 0) return out;
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A.rows(), A.cols());
    qr.setThreshold(kNegligible).compute(A);
    const Eigen::VectorXd x = qr.solve(b);
    const Eigen::MatrixXd N = null_space(qr);
    for (const auto& [u, first] : at)
      if (N.middleRows(first, u.dim()).isZero(1e-9)) out[u] = x.segment(first, u.dim());
    return out;
  }
  // Of the information of all of some priors, H = RᵀR and g = Rᵀd, from that of others: the largest of any scalar,
  // beside the largest there is.
  static double difference(const std::vector<Prior>& some, const std::vector<Prior>& others) {
    std::map<Unknown, int> at;
    int n = 0;
    for (const auto* priors : {&some, &others})
      for (const Prior& p : *priors)
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
  static std::vector<std::pair<int, Time>> times(const Measured& m) {
    using Kind = Measured::Kind;
    if (m.kind == Kind::landmark) return {};
    if (m.kind == Kind::level || m.kind == Kind::offset) return {{1, m.a}};
    if (m.kind == Kind::step) return {{0, m.a}, {0, m.b}};
    if (m.kind == Kind::tie) return {{0, m.a}, {1, m.b}};
    return {{0, m.a}};
  }
  static bool names_landmark(const Measured& m) {
    return m.kind == Measured::Kind::sight || m.kind == Measured::Kind::landmark;
  }
  static Row row_of(const Measured& m) {
    using Kind = Measured::Kind;
    const Unknown x{What::position, m.a.ns}, l{What::landmark, m.landmark};
    const Eigen::Vector2d z(m.z[0], m.z[1]);
    const Eigen::VectorXd z1 = Eigen::VectorXd::Constant(1, m.z[0]);
    switch (m.kind) {
      case Kind::position:
        return {{{x}}, z, m.sigma, {}};
      case Kind::step:
        return {{{{What::position, m.b.ns}}, {x, -1.0}}, z, m.sigma, {}};
      case Kind::sight:
        return {{{l}, {x, -1.0}}, z, m.sigma, {}};
      case Kind::landmark:
        return {{{l}}, z, m.sigma, {}};
      case Kind::level:
        return {{{{What::level, m.a.ns}}}, Eigen::Vector3d(m.z[0], m.z[1], m.z[2]), m.sigma, {}};
      case Kind::offset:
        return {{{{What::offset, m.a.ns}}}, z1, m.sigma, {}};
      default:
        return {{{x, 1.0, 0}, {{What::offset, m.b.ns}, -1.0}}, z1, m.sigma, {}};
    }
  }

 private:
  static bool touches(const Row& r, const Unknown& u) {
    return std::any_of(r.terms.begin(), r.terms.end(), [&](const auto& t) { return t.of == u; });
  }
  static bool names_landmark(const Row& r, const std::vector<int>& some) {
    return std::any_of(some.begin(), some.end(), [&](int l) { return touches(r, {What::landmark, l}); });
  }
  void keep(Prior prior) {
    if (!prior.of.empty() && prior.d.size() > 0) priors_.push_back(std::move(prior));
  }
  // What leaves together and shares no unknown makes priors apart (M11). Later that matters: of priors that know a
  // variable which is removed, each keeps what it alone says of others (V6), and not what only all of them together
  // would.
  struct Part {
    std::set<Unknown> of;
    std::vector<Row> rows;
    std::vector<Prior> priors;
  };
  static std::vector<Part> parts(const std::vector<Row>& rows, const std::vector<Prior>& priors) {
    std::vector<Part> all;
    for (const Row& r : rows) {
      Part alone;
      for (const auto& t : r.terms) alone.of.insert(t.of);
      alone.rows.push_back(r);
      join(all, std::move(alone));
    }
    for (const Prior& p : priors) join(all, {{p.of.begin(), p.of.end()}, {}, {p}});
    return all;
  }
  static void join(std::vector<Part>& all, Part whole) {
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
  static constexpr double kNegligible = 1e-11;  // of a pivot, beside the largest
  // Its columns: A P = Q [R S; 0 0], so that A P [-R⁻¹ S; I] = 0. Some of its entries are of the size of 1.
  static Eigen::MatrixXd null_space(const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& qr) {
    const Eigen::Index n = qr.cols(), r = qr.rank();
    Eigen::MatrixXd N = Eigen::MatrixXd::Identity(n, n).rightCols(n - r);
    const Eigen::MatrixXd S = qr.matrixR().topRightCorner(r, n - r);
    N.topRows(r) = -qr.matrixR().topLeftCorner(r, r).triangularView<Eigen::Upper>().solve(S);
    return qr.colsPermutation() * N;
  }
  // With the motions between neighbours.
  std::vector<Row> all_rows() const {
    std::vector<Row> all = rows_;
    for (int c = 0; c < 2; ++c)
      for (auto b = chains[c].begin(); b != chains[c].end(); ++b) {
        if (b == chains[c].begin() || b->second.severed) continue;
        const Time from = std::prev(b)->first, to = b->first;
        const double sigma = Increments<2>::sigma(from, to);
        if (c == 0) {
          const Vec2d z = moved.between(from, to);
          all.push_back(
              {{{{What::position, to.ns}}, {{What::position, from.ns}, -1.0}}, Eigen::Vector2d(z[0], z[1]), sigma, {}});
        } else {
          const Vec4d z = levelled.between(from, to);
          all.push_back(
              {{{{What::level, to.ns}}, {{What::level, from.ns}, -1.0}}, Eigen::Vector3d(z[0], z[1], z[2]), sigma, {}});
          all.push_back({{{{What::offset, to.ns}}, {{What::offset, from.ns}, -1.0}},
                         Eigen::VectorXd::Constant(1, z[3]),
                         sigma,
                         {}});
        }
      }
    return all;
  }
  // The rows, whitened, and the priors below them.
  static std::pair<Eigen::MatrixXd, Eigen::VectorXd> stack(const std::vector<Row>& rows,
                                                           const std::vector<Prior>& priors,
                                                           const std::map<Unknown, int>& at, int n) {
    Eigen::Index m = 0, i = 0;
    for (const Row& r : rows) m += r.z.size();
    for (const Prior& p : priors) m += p.d.size();
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(std::max<Eigen::Index>(m, n), n);  // QR wants as many rows as columns
    Eigen::VectorXd b = Eigen::VectorXd::Zero(A.rows());
    for (const Row& r : rows) {
      for (const auto& t : r.terms)
        for (int d = 0; d < r.z.size(); ++d) A(i + d, at.at(t.of) + (t.scalar >= 0 ? t.scalar : d)) += t.sign / r.sigma;
      b.segment(i, r.z.size()) = r.z / r.sigma;
      i += r.z.size();
    }
    for (const Prior& p : priors) {
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
  // What rows and priors say of the others: the leaving columns first, what is below their rows after reflections.
  static Prior eliminated(const std::set<Unknown>& leaving, const std::vector<Row>& rows,
                          const std::vector<Prior>& priors) {
    std::map<Unknown, int> at;
    int n = 0;
    for (const Unknown& u : leaving) at[u] = n, n += u.dim();
    const int gone = n;
    Prior rest;
    auto stays = [&](const Unknown& u) {
      if (!at.emplace(u, n).second) return;
      rest.of.push_back(u);
      n += u.dim();
    };
    for (const Row& r : rows)
      for (const auto& t : r.terms) stays(t.of);
    for (const Prior& p : priors)
      for (const Unknown& u : p.of) stays(u);
    const int kept = n - gone;
    if (kept == 0) return rest;
    const auto [A, b] = stack(rows, priors, at, n);
    Eigen::MatrixXd right(A.rows(), kept + 1);
    right << A.rightCols(kept), b;
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A.leftCols(gone));
    right.applyOnTheLeft(qr.householderQ().transpose());
    const Eigen::Index rows_left = right.rows() - qr.rank();
    rest.R = right.bottomLeftCorner(rows_left, kept);
    rest.d = right.col(kept).tail(rows_left);
    if (rows_left > kept) {  // no more rows than a triangle has
      const Eigen::HouseholderQR<Eigen::MatrixXd> triangle(rest.R);
      rest.d = (triangle.householderQ().transpose() * rest.d).head(kept).eval();
      rest.R = Eigen::MatrixXd(triangle.matrixQR().topRows(kept).triangularView<Eigen::Upper>());
    }
    return rest;
  }

  std::vector<Row> rows_;
  std::vector<Prior> priors_;
};

}  // namespace oriel::linear_world
