// A window as a mathematician would keep it: states and landmarks by what they are, a list of rows, dense priors in
// square-root form. It shares no code with the library's window, and is what that is compared with after any operation.
#pragma once
#include <optional>
#include <string>

#include "linear_window.h"
#include "model_ledger.h"

namespace oriel::linear_world {

class WindowModel {
 public:
  using Row = ModelRow;
  using Prior = ModelPrior;
  struct Node {
    bool severed = false;
  };
  using Chain = std::map<Time, Node>;
  using Values = std::map<Unknown, Eigen::VectorXd>;

  Chain chains[2];  // positions, levels
  Increments<2> moved;
  Increments<4> levelled;
  std::set<int> landmarks;
  std::vector<Prior> theirs;  // the window's priors when it was last looked at
  bool faint = false;         // something was dropped of which a prior knew next to nothing
  std::string wrong;          // what the window did that it may not do

  // ---- of late groups ----
  bool remembers = false;
  ModelLedger ledger;
  std::set<Time> left[2];  // states that left, by chain, or came into the ledger alone
  Time horizons[2] = {States::kNever, States::kNever};
  std::vector<Time> made;  // states of the last late group, in the ledger alone

  static std::vector<Unknown> unknowns(int chain, Time t) {
    if (chain == 0) return {{What::position, t.ns}};
    return {{What::level, t.ns}, {What::offset, t.ns}};
  }

  // ---- what happens ----
  void enter(const MeasuredGroup& group, const std::vector<FactorId>& factors) {
    std::set<std::pair<Time, int>> named;  // in the order of time
    bool late = false;
    for (const Measured& m : group) {
      if (m.bad) wrong = "a NaN entered";
      for (const auto& [chain, time] : times(m)) {
        if (is_dead(chain, time))
          late = true;
        else
          named.emplace(time, chain);
      }
    }
    for (const auto& [time, chain] : named) add_state(chain, time);
    for (std::size_t k = 0; !late && k < group.size(); ++k) {
      Row row = row_of(group[k]);
      row.factor = factors[k];
      for (const auto& t : row.terms)
        if (t.of.what == What::landmark) landmarks.insert(static_cast<int>(t.of.number));
      rows_.push_back(std::move(row));
    }
    if (late) enter_late(group);
  }
  void add_state(int chain, Time time) {
    Chain& line = chains[chain];
    if (line.count(time) > 0) return;
    for (const Unknown& u : unknowns(chain, time)) ledger.disown(u);
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
    std::erase_if(rows_, [&](const Row& r) { return r.touches(u); });
    if (u.what == What::landmark) landmarks.erase(static_cast<int>(u.number));
    ledger.disown(u);
    for (std::size_t k = priors_.size(); k-- > 0;) {
      if (!priors_[k].names(u)) continue;
      const Prior whole = std::move(priors_[k]);
      priors_.erase(priors_.begin() + static_cast<std::ptrdiff_t>(k));
      // Between what is_faint takes for rounding and what it takes for knowledge.
      const double least = std::sqrt(kRounding * kFaint) * whole.R.cwiseAbs().maxCoeff();
      keep(algebra::eliminated({u}, {}, {whole}, least), {}, {whole});
    }
  }
  void remove_state(int chain, Time time) {
    for (const Unknown& u : unknowns(chain, time)) remove(u);
    Chain& line = chains[chain];
    const bool severed = line[time].severed;
    const auto next = line.erase(line.find(time));
    if (next != line.end()) next->second.severed |= severed;
  }
  // What a slide has to say of landmarks that leaving states see, as these leave by policy.
  struct Landmarks {
    int leaving = 0, kept = 0, closed = 0, dropped = 0, lost_rows = 0;
    std::set<int> gone;
  };
  // States of both kinds leave, and with them landmarks; what they knew stays.
  Landmarks marginalize(const std::vector<std::pair<int, Time>>& states, LandmarkPolicy policy) {
    std::set<Unknown> leaving;
    Time newest = States::kNever;
    for (const auto& [chain, time] : states) {
      for (const Unknown& u : unknowns(chain, time)) leaving.insert(u);
      newest = std::max(newest, time);
    }
    Landmarks by_policy = judge_landmarks(leaving, policy);
    for (const int l : by_policy.gone) leaving.insert({What::landmark, l});
    eliminate(leaving, remembers ? &newest : nullptr);
    for (const auto& [chain, time] : states) {
      const auto next = chains[chain].erase(chains[chain].find(time));
      if (next != chains[chain].end()) next->second.severed = true;
      if (remembers) left[chain].insert(time);
    }
    for (const int l : by_policy.gone) landmarks.erase(l);
    return by_policy;
  }
  // The user's own: the landmark leaves, and nobody remembers what it is given the others.
  void marginalize_landmark(int l) {
    eliminate({{What::landmark, l}}, nullptr);
    landmarks.erase(l);
  }
  // A factor leaves and joins that prior; where there is none, it becomes one.
  void absorb(FactorId id, std::optional<std::size_t> host) {
    std::vector<Row> rows;
    for (const Row& r : rows_)
      if (r.factor == id) rows.push_back(r);
    remove_factor(id);
    absorb(rows, host);
  }
  void absorb_motion(int chain, Time to, std::optional<std::size_t> host) {
    const auto b = chains[chain].find(to);
    absorb(motion(chain, std::prev(b)->first, to), host);
    b->second.severed = true;
  }
  // What is too old in the ledger goes.
  void forget(std::size_t capacity, Duration horizon, const std::function<bool(const Unknown&)>& is_gone) {
    ledger.forget(capacity, horizon, is_gone);
    for (int c = 0; c < 2; ++c)
      while (!left[c].empty() && !holds_any(c, *left[c].begin())) left[c].erase(left[c].begin());
  }
  void begin_anew() {
    for (Chain& c : chains) c.clear();
    rows_.clear();
    landmarks.clear();
    priors_.clear();
    ledger.clear();
    for (auto& times : left) times.clear();
  }

  // ---- what is known ----
  // Whether a prior knows so little of it that what is left without it hangs on how much of that little is rounding:
  // what is not known at all takes nothing along when it is removed, and what is known ever so faintly does.
  // Of its own priors and the window's, which need not take the same for rounding.
  bool is_faint(const Unknown& u) const {
    const auto faint_in = [&](const Prior& p) {
      if (!p.names(u)) return false;
      const double all = p.R.cwiseAbs().maxCoeff();
      const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(p.columns(u));
      const Eigen::VectorXd s = qr.matrixR().diagonal().cwiseAbs();
      return (s.array() > kRounding * all && s.array() < kFaint * all).any();
    };
    return std::any_of(priors_.begin(), priors_.end(), faint_in) || std::any_of(theirs.begin(), theirs.end(), faint_in);
  }
  bool lives(const Unknown& u) const {
    if (u.what == What::landmark) return landmarks.count(static_cast<int>(u.number)) > 0;
    return chains[u.what == What::position ? 0 : 1].count({u.number}) > 0;
  }
  // Whether the window cannot have a state there any more: it was there, or would come before or between others.
  bool is_dead(int chain, Time time) const {
    const Chain& line = chains[chain];
    if (line.empty()) return time < horizons[chain];
    const auto after = line.lower_bound(time);
    if (after == line.end() || after->first == time) return false;
    return after == line.begin() ? time < horizons[chain] : after->second.severed;
  }
  // The nearest states, be they there or remembered, of a time that never had one.
  std::optional<std::pair<Time, Time>> neighbours(int chain, Time time) const {
    std::set<Time> all = left[chain];
    for (const auto& [t, node] : chains[chain]) all.insert(t);
    const auto b = all.upper_bound(time);
    if (b == all.begin() || b == all.end()) return {};
    return std::pair(*std::prev(b), *b);
  }
  bool was_there(int chain, Time time) const { return left[chain].count(time) > 0; }
  bool is_cut(int chain, Time time) const {
    return ledger.is_cut(unknowns(chain, time), [this](const Unknown& u) { return lives(u); });
  }
  // Whether all that rows and priors tie to a landmark is of these.
  bool sees_alone(int landmark, const std::set<Unknown>& states) const {
    const Unknown l{What::landmark, landmark};
    auto strange = [&](const Unknown& u) { return u != l && states.count(u) == 0; };
    for (const Row& r : rows_)
      if (r.touches(l))
        for (const auto& t : r.terms)
          if (strange(t.of)) return false;
    return std::none_of(priors_.begin(), priors_.end(),
                        [&](const Prior& p) { return p.names(l) && std::any_of(p.of.begin(), p.of.end(), strange); });
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
    const auto [A, b] = algebra::stack(rows, priors_, at, n);
    Values out;
    if (n == 0) return out;
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A.rows(), A.cols());
    qr.setThreshold(algebra::kNegligible).compute(A);
    const Eigen::VectorXd x = algebra::solved(qr, b);
    const Eigen::MatrixXd N = algebra::null_space(qr);
    for (const auto& [u, first] : at)
      if (N.middleRows(first, u.dim()).isZero(1e-9)) out[u] = x.segment(first, u.dim());
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
  static constexpr double kRounding = 1e-15, kFaint = 1e-7;  // beside the largest number of a prior
  // Without the columns in which there is nothing but rounding, beside what it was made of.
  void keep(Prior prior, const std::vector<Row>& rows, const std::vector<Prior>& priors) {
    double scale = 0.0;
    for (const Row& r : rows) scale = std::max(scale, 1.0 / r.sigma);
    for (const Prior& p : priors) scale = std::max(scale, p.R.cwiseAbs().maxCoeff());
    algebra::prune(prior.of, prior.R, 0, 1e-13 * scale);
    if (!prior.of.empty() && prior.d.size() > 0) priors_.push_back(std::move(prior));
  }
  Landmarks judge_landmarks(const std::set<Unknown>& leaving, LandmarkPolicy policy) {
    Landmarks out;
    for (const int l : landmarks) {
      const Unknown u{What::landmark, l};
      if (std::none_of(rows_.begin(), rows_.end(),
                       [&](const Row& r) { return r.touches(u) && r.touches_any(leaving); }))
        continue;
      const bool alone = sees_alone(l, leaving);
      const bool keep = !alone && policy == LandmarkPolicy::keep, drop = !alone && policy == LandmarkPolicy::drop;
      out.leaving += alone, out.kept += keep, out.dropped += drop, out.closed += !alone && !keep && !drop;
      if (!keep) out.gone.insert(l);
      faint = faint || (drop && is_faint(u));
      if (drop) out.lost_rows += static_cast<int>(std::erase_if(rows_, [&](const Row& r) { return r.touches(u); }));
    }
    return out;
  }
  // Unknowns leave with the rows and priors that touch them. With a stamp, what they are given the others is kept.
  void eliminate(const std::set<Unknown>& leaving, const Time* stamp) {
    std::vector<Row> absorbed;
    for (const Row& r : all_rows())
      if (r.touches_any(leaving)) absorbed.push_back(r);
    std::erase_if(rows_, [&](const Row& r) { return r.touches_any(leaving); });
    std::vector<Prior> used;
    std::erase_if(priors_, [&](const Prior& p) {
      if (p.names_any(leaving)) used.push_back(p);
      return p.names_any(leaving);
    });
    for (const algebra::Part& part : algebra::parts(absorbed, used)) {
      std::set<Unknown> gone;
      for (const Unknown& u : leaving)
        if (part.of.count(u) > 0) gone.insert(u);
      if (stamp != nullptr) remember(part, gone, *stamp);
      keep(algebra::eliminated(gone, part.rows, part.priors), part.rows, part.priors);
    }
  }
  // But for landmarks that no prior knew: late factors through these are refused (decision 14).
  void remember(const algebra::Part& part, const std::set<Unknown>& gone, Time stamp) {
    std::set<Unknown> forgotten, kept;
    for (const Unknown& u : gone) {
      const bool in_prior =
          std::any_of(part.priors.begin(), part.priors.end(), [&](const Prior& p) { return p.names(u); });
      (u.what == What::landmark && !in_prior ? forgotten : kept).insert(u);
    }
    if (kept.empty()) return;
    const Prior rest = algebra::eliminated(forgotten, part.rows, part.priors);
    ledger.keep_newest(algebra::eliminate(kept, {}, {rest}).known, stamp);
  }
  void absorb(const std::vector<Row>& rows, std::optional<std::size_t> host) {
    std::vector<Prior> old;
    if (host) {
      old.push_back(priors_[*host]);
      priors_.erase(priors_.begin() + static_cast<std::ptrdiff_t>(*host));
    }
    keep(algebra::eliminated({}, rows, old), rows, old);
  }
  bool holds_any(int chain, Time time) const {
    const auto all = unknowns(chain, time);
    return std::any_of(all.begin(), all.end(), [this](const Unknown& u) { return ledger.holds(u); });
  }
  void enter_late(const MeasuredGroup& group) {
    made.clear();
    for (const Measured& m : group)
      for (const auto& [chain, time] : times(m)) make_state(chain, time);
    for (const Measured& m : group) {
      Row row = row_of(m);
      if (std::all_of(row.terms.begin(), row.terms.end(), [this](const auto& t) { return lives(t.of); })) {
        rows_.push_back(std::move(row));
        continue;
      }
      auto prior = ledger.fold(row, [this](const Unknown& u) { return lives(u); });
      if (!prior)
        wrong = "a late group was folded whose way is cut";
      else
        keep(std::move(*prior), {row}, {});
    }
  }
  // p(s | neighbours) of a time that never had a state; what the halves of its motion say of these is known already.
  void make_state(int chain, Time time) {
    if (!is_dead(chain, time) || was_there(chain, time)) return;
    const auto between = neighbours(chain, time);
    if (!between) return void(wrong = "a late state has come into being that has no neighbours");
    std::vector<Row> halves = motion(chain, between->first, time);
    for (Row& r : motion(chain, time, between->second)) halves.push_back(std::move(r));
    const auto unknown = unknowns(chain, time);
    made.push_back(time);
    left[chain].insert(time);
    ledger.keep_oldest(algebra::eliminate({unknown.begin(), unknown.end()}, halves, {}).known, made.front());
  }
  // From one time to another.
  std::vector<Row> motion(int chain, Time from, Time to) const {
    const double sigma = Increments<2>::sigma(from, to);
    auto row = [&](What what, const Eigen::VectorXd& z) {
      return Row{{{{what, to.ns}}, {{what, from.ns}, -1.0}}, z, sigma, {}};
    };
    if (chain == 0) {
      const Vec2d z = moved.between(from, to);
      return {row(What::position, Eigen::Vector2d(z[0], z[1]))};
    }
    const Vec4d z = levelled.between(from, to);
    return {row(What::level, Eigen::Vector3d(z[0], z[1], z[2])), row(What::offset, Eigen::VectorXd::Constant(1, z[3]))};
  }
  // With the motions between neighbours.
  std::vector<Row> all_rows() const {
    std::vector<Row> all = rows_;
    for (int c = 0; c < 2; ++c)
      for (auto b = chains[c].begin(); b != chains[c].end(); ++b)
        if (b != chains[c].begin() && !b->second.severed)
          for (Row& r : motion(c, std::prev(b)->first, b->first)) all.push_back(std::move(r));
    return all;
  }

  std::vector<Row> rows_;
  std::vector<Prior> priors_;
};

}  // namespace oriel::linear_world
