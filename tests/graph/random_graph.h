// A graph that changes at random, and what it should be, kept by the simplest means: for tests of followers.
#pragma once
#include <algorithm>
#include <random>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"

namespace oriel::testing_graph {

// A point seen in the body's frame [m], differentiated by dual numbers.
struct SeenPoint {
  static constexpr std::string_view kName = "test.seen_point/1";
  using Variables = Types<Pose3d, Point3d>;
  Vec3d p_body;
  template <class S>
  Vec<S, 3> operator()(const Pose3<S>& T_world_body, const Point3<S>& p) const {
    const Vec<S, 3> seen = T_world_body.inverse() * p.p;
    return {{seen[0] - p_body[0], seen[1] - p_body[1], seen[2] - p_body[2]}};
  }
};

inline TypeList random_graph_types() {
  TypeList types;
  types.factor<Prior<Pose3d>, IsotropicNoise>().factor<Prior<Pose3d>, FullNoise<6>>();
  types.factor<Prior<Point3d>, IsotropicNoise>().factor<Prior<Velocity3d>, IsotropicNoise>();
  types.factor<Between<Pose3d>, IsotropicNoise>().factor<Between<Pose3d>, DiagonalNoise<6>>();
  types.factor<Between<Point3d>, IsotropicNoise>().factor<SeenPoint, IsotropicNoise>();
  return types;
}

class RandomGraph {
 public:
  Graph graph;

  // `restricts`: directions of variables are held and let go as well.
  explicit RandomGraph(unsigned seed, bool restricts = false) : random_(seed), restricts_(restricts) {}

  // What a live variable or factor should be.
  struct Item {
    VariableKey id;
    bool fixed = false;
  };
  struct FactorItem {
    FactorId id;
    std::vector<VariableKey> variables;
  };
  const std::vector<Item>& variables() const { return variables_; }
  const std::vector<FactorItem>& factors() const { return factors_; }
  std::size_t prior_count() const { return graph.priors().slots().size(); }

  // One edit of up to `most` steps, applied; false if the graph refused it.
  bool step(int most) {
    GraphEdit edit = graph.edit();
    const int steps = 1 + below(most);
    for (int i = 0; i < steps; ++i) one(edit);
    const auto ok = graph.apply(edit);
    return ok.ok();
  }

  std::mt19937& random() { return random_; }
  int below(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }

 private:
  double number(double scale = 1.0) { return scale * std::normal_distribution<double>()(random_); }
  Vec6d vec6(double scale) {
    Vec6d d;
    for (int i = 0; i < 6; ++i) d[i] = number(scale);
    return d;
  }
  Vec3d vec3(double scale) { return {{number(scale), number(scale), number(scale)}}; }
  Pose3d pose() { return Pose3d{}.plus(vec6(0.8)); }
  Loss loss() { return below(4) == 0 ? Huber(1.0) : below(9) == 0 ? Cauchy(2.0) : Loss::none(); }

  template <class V>
  bool pick(VariableId<V>& id) {
    std::vector<SlotKey> keys;
    for (const Item& v : variables_)
      if (v.id.type == kVariableOps<V>.key) keys.push_back(v.id.key);
    if (keys.empty()) return false;
    id.key = keys[static_cast<std::size_t>(below(static_cast<int>(keys.size())))];
    return true;
  }

  template <class V>
  void remember(VariableId<V> id) {
    variables_.push_back({id, false});
  }

  void one(GraphEdit& edit) {
    const int what = below(20);
    if (what < 4 || variables_.size() < 6)
      add_variable(edit);
    else if (what < 11)
      add_factor(edit);
    else if (what < 13)
      set_value(edit);
    else if (what < 14)
      fix(edit);
    else if (what < 15)
      add_linear_prior(edit);
    else if (what < 17)
      remove_factor(edit);
    else
      remove_variable(edit);
  }

  void add_variable(GraphEdit& edit) {
    const int kind = below(5);
    if (kind < 2) {
      const auto id = edit.add(pose(), Label("x", below(1000)));
      remember(id);
      if (below(2)) note(edit.add(Prior{pose()}, Sigma(0.5), id), {id});
    } else if (kind < 4) {
      const auto id = edit.add(Point3d{vec3(3.0)});
      remember(id);
      if (below(2)) note(edit.add(Prior{Point3d{vec3(3.0)}}, Sigma(1.0), id), {id});
    } else {
      const auto id = edit.add(Velocity3d{vec3(1.0)});
      remember(id);
      note(edit.add(Prior{Velocity3d{vec3(1.0)}}, Sigma(1.0), loss(), id), {id});
    }
  }

  void add_factor(GraphEdit& edit) {
    VariableId<Pose3d> a, b;
    VariableId<Point3d> p, q;
    const int kind = below(8);
    if (kind < 3 && pick(a) && pick(p))
      note(edit.add(SeenPoint{vec3(2.0)}, Sigma(0.3), loss(), a, p), {a, p});
    else if (kind < 5 && pick(a) && pick(b) && a != b)
      note(edit.add(Between{pose()}, Sigma(0.2), loss(), a, b), {a, b});
    else if (kind < 6 && pick(a) && pick(b) && a != b)
      note(edit.add(Between{pose()}, Sigmas(Vec6d{{.1, .2, .3, .4, .5, .6}}), loss(), a, b), {a, b});
    else if (kind < 7 && pick(p) && pick(q) && p != q)
      note(edit.add(Between{Point3d{vec3(1.0)}}, Sigma(0.7), p, q), {p, q});
    else if (pick(a))
      note(edit.add(Prior{pose()}, SqrtInformation(Mat6d::identity()), a), {a});
  }

  void set_value(GraphEdit& edit) {
    if (below(3) == 0) return set_loss(edit);
    VariableId<Pose3d> a;
    VariableId<Point3d> p;
    if (below(2) && pick(a))
      edit.set(a, pose());
    else if (pick(p))
      edit.set(p, Point3d{vec3(3.0)});
  }

  void set_loss(GraphEdit& edit) {
    if (factors_.empty()) return;
    const FactorId id = factors_[static_cast<std::size_t>(below(static_cast<int>(factors_.size())))].id;
    if (graph.contains(id)) edit.set(id, below(2) ? TruncatedSquares(1.0 + below(5), 0.1) : loss());
  }

  void fix(GraphEdit& edit) {
    Item& v = variables_[static_cast<std::size_t>(below(static_cast<int>(variables_.size())))];
    if (restricts_ && below(4) > 0) return edit.set(v.id, freedom(v.id.type == kVariableOps<Pose3d>.key));
    v.fixed = below(3) == 0;
    edit.fix(v.id, v.fixed);
  }

  Freedom freedom(bool pose) {
    if (below(4) == 0) return Freedom::full();
    if (!pose) return Freedom::hold({below(3)}, below(2) ? Freedom::Axes::world : Freedom::Axes::body);
    const Freedom of_poses[] = {Freedom::position(), Freedom::rotation(), Freedom::yaw(), Freedom::planar()};
    return of_poses[below(4)];
  }

  // Over up to three poses.
  void add_linear_prior(GraphEdit& edit) {
    LinearPrior prior;
    for (int k = 0; k < 3; ++k) {
      VariableId<Pose3d> a;
      if (!pick(a) ||
          std::find(prior.variables.begin(), prior.variables.end(), VariableKey(a)) != prior.variables.end())
        continue;
      const Pose3d x = edit.value(a);
      prior.variables.push_back(a);
      prior.estimates.resize(prior.estimates.size() + estimate_doubles(kVariableOps<Pose3d>));
      std::memcpy(prior.estimates.data() + prior.estimates.size() - estimate_doubles(kVariableOps<Pose3d>), &x,
                  sizeof(x));
    }
    if (prior.variables.empty()) return;
    prior.cols = 6 * static_cast<int>(prior.variables.size());
    prior.rows = prior.cols;
    for (int i = 0; i < prior.rows; ++i) prior.d.push_back(number(0.1));
    for (int i = 0; i < prior.rows * prior.cols; ++i) prior.R.push_back(number(0.5));
    edit.add(prior);
  }

  static bool sets_loss(const GraphEdit& edit, FactorId id) {
    for (const auto& c : edit.factor_columns())
      for (const auto& [key, loss] : c->losses)
        if (c->ops->key == id.table && key == id.key) return true;
    return false;
  }

  // Only what is in the graph can be removed.
  void remove_factor(GraphEdit& edit) {
    if (factors_.empty()) return;
    const std::size_t i = static_cast<std::size_t>(below(static_cast<int>(factors_.size())));
    if (!graph.contains(factors_[i].id) || sets_loss(edit, factors_[i].id)) return;
    edit.remove(factors_[i].id);
    factors_.erase(factors_.begin() + static_cast<std::ptrdiff_t>(i));
  }

  void remove_variable(GraphEdit& edit) {
    const std::size_t i = static_cast<std::size_t>(below(static_cast<int>(variables_.size())));
    const VariableKey id = variables_[i].id;
    if (graph.find_value(id) == nullptr || named(edit, id)) return;
    edit.remove(id);
    variables_.erase(variables_.begin() + static_cast<std::ptrdiff_t>(i));
    std::erase_if(factors_, [&](const FactorItem& f) {
      return std::find(f.variables.begin(), f.variables.end(), id) != f.variables.end();
    });
  }

  // Does the edit already say something of this variable that its removal would contradict?
  static bool named(const GraphEdit& edit, VariableKey id) {
    const edit::Variables* c = edit.find_variables(id.type);
    if (c != nullptr) {
      for (const auto& s : c->set)
        if (s.first == id.key) return true;
      for (const auto& f : c->fixed)
        if (f.first == id.key) return true;
      for (const auto& f : c->freedoms)
        if (f.first == id.key) return true;
    }
    for (const VariableKey& v : edit.priors().variables)
      if (v == id) return true;
    for (const auto& f : edit.factor_columns())
      for (std::size_t k = 0; k < f->variables.size(); ++k)
        if (f->ops->variables[k % f->ops->variables.size()]->key == id.type && f->variables[k] == id.key) return true;
    return false;
  }

  void note(FactorId id, std::vector<VariableKey> variables) { factors_.push_back({id, std::move(variables)}); }

  std::mt19937 random_;
  bool restricts_;
  std::vector<Item> variables_;
  std::vector<FactorItem> factors_;
};

}  // namespace oriel::testing_graph
