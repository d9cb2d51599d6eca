// A window as a mathematician would keep it: states and landmarks by what they are, a list of rows, a dense prior in
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
  // A landmark or state leaves with its rows; a prior keeps what it says of others.
  void remove(const Unknown& u) {
    std::erase_if(rows_, [&](const Row& r) { return touches(r, u); });
    landmarks_erase(u);
    eliminate({u}, {});
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
    eliminate(leaving, absorbed);
  }
  void begin_anew() {
    for (Chain& c : chains) c.clear();
    rows_.clear();
    landmarks.clear();
    prior_of_.clear();
    prior_R_.resize(0, 0);
    prior_d_.resize(0);
  }

  // ---- what is known ----
  // Rows of no landmark but that one, and of states of a set, are all that a landmark has.
  bool sees_alone(int landmark, const Unknown& state) const {
    for (const Row& r : rows_)
      if (touches(r, {What::landmark, landmark}))
        for (const auto& t : r.terms)
          if (t.of.what != What::landmark && !(t.of == state)) return false;
    return std::find(prior_of_.begin(), prior_of_.end(), Unknown{What::landmark, landmark}) == prior_of_.end();
  }
  const std::vector<Row>& rows() const { return rows_; }
  // Of what any row or prior names.
  Values solve() const {
    std::map<Unknown, int> at;
    int n = 0;
    auto place = [&](const Unknown& u) {
      if (at.emplace(u, n).second) n += u.dim();
    };
    const std::vector<Row> rows = all_rows();
    for (const Row& r : rows)
      for (const auto& t : r.terms) place(t.of);
    for (const Unknown& u : prior_of_) place(u);
    const auto [A, b] = stack(rows, at, n);
    Values out;
    if (n == 0) return out;
    const Eigen::VectorXd x = A.householderQr().solve(b);
    for (const auto& [u, first] : at) out[u] = x.segment(first, u.dim());
    return out;
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
  void landmarks_erase(const Unknown& u) {
    if (u.what == What::landmark) landmarks.erase(static_cast<int>(u.number));
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
  // The rows, whitened, and the prior below them.
  std::pair<Eigen::MatrixXd, Eigen::VectorXd> stack(const std::vector<Row>& rows, const std::map<Unknown, int>& at,
                                                    int n) const {
    int m = static_cast<int>(prior_R_.rows());
    for (const Row& r : rows) m += static_cast<int>(r.z.size());
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(std::max(m, n), n);  // rows of zeros: QR wants as many as columns
    Eigen::VectorXd b = Eigen::VectorXd::Zero(std::max(m, n));
    int i = 0;
    for (const Row& r : rows) {
      for (const auto& t : r.terms)
        for (int d = 0; d < r.z.size(); ++d) A(i + d, at.at(t.of) + (t.scalar >= 0 ? t.scalar : d)) += t.sign / r.sigma;
      b.segment(i, r.z.size()) = r.z / r.sigma;
      i += static_cast<int>(r.z.size());
    }
    int column = 0;
    for (const Unknown& u : prior_of_) {
      A.block(i, at.at(u), prior_R_.rows(), u.dim()) = prior_R_.middleCols(column, u.dim());
      column += u.dim();
    }
    b.segment(i, prior_d_.size()) = prior_d_;
    return {A, b};
  }
  // Leaving columns first: below their rows of the triangle stands what is known of the rest.
  void eliminate(const std::set<Unknown>& leaving, const std::vector<Row>& absorbed) {
    std::map<Unknown, int> at;
    int n = 0;
    auto place = [&](const Unknown& u) {
      if (at.emplace(u, n).second) n += u.dim();
    };
    for (const Unknown& u : leaving) place(u);
    const int gone = n;
    std::vector<Unknown> rest;
    auto keep = [&](const Unknown& u) {
      if (at.count(u) == 0) rest.push_back(u);
      place(u);
    };
    for (const Row& r : absorbed)
      for (const auto& t : r.terms) keep(t.of);
    for (const Unknown& u : prior_of_) keep(u);
    const auto [A, b] = stack(absorbed, at, n);
    const int kept = n - gone;
    Eigen::MatrixXd right(A.rows(), kept + 1);
    right << A.rightCols(kept), b;
    Eigen::Index used = 0;  // rows that tell the leaving ones
    if (gone > 0) {
      const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A.leftCols(gone));
      used = qr.rank();
      right.applyOnTheLeft(qr.householderQ().transpose());
    }
    prior_of_ = rest;
    prior_R_ = right.bottomLeftCorner(right.rows() - used, kept);
    prior_d_ = right.col(kept).tail(right.rows() - used);
    compress(kept);
  }
  // No more rows than a triangle has.
  void compress(int columns) {
    if (prior_R_.rows() <= columns) return;
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(prior_R_);
    prior_d_ = (qr.householderQ().transpose() * prior_d_).head(columns).eval();
    prior_R_ = Eigen::MatrixXd(qr.matrixQR().topRows(columns).triangularView<Eigen::Upper>());
  }

  std::vector<Row> rows_;
  std::vector<Unknown> prior_of_;
  Eigen::MatrixXd prior_R_;
  Eigen::VectorXd prior_d_;
};

}  // namespace oriel::linear_world
