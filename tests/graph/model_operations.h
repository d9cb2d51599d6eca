// Random operations on a graph, each made on a model of it as well.
#pragma once
#include <cmath>

#include "graph/graph_model.h"

namespace oriel::testing_graph {

class ModelOperations {
 public:
  Graph graph;
  GraphModel model;

  explicit ModelOperations(unsigned seed) : random_(seed) {}

  struct Counts {
    std::int64_t added = 0, removed = 0, set = 0, flagged = 0, raised_nothing = 0, estimates = 0, priors = 0,
                 losses = 0, came_and_went = 0, adopted = 0, kept_from_solution = 0, refused = 0, cleared = 0,
                 restricted = 0;
  };
  const Counts& counts() const { return counts_; }
  const std::string& error() const { return error_; }
  // What the last operation gave the values of, if it adopted a solution: those that the graph took.
  const Solution* taken() const { return adopted_ ? &taken_ : nullptr; }

  void step() {
    adopted_ = false;
    ++steps_;
    const bool grows = steps_ / 300 % 3 != 2 && model.variables.size() < 50;
    const int what = below(100);
    if (steps_ % 5000 == 0) return clear();
    if (model.variables.size() < 4 || what < (grows ? 10 : 4)) return add_variable();
    if (what < (grows ? 30 : 14)) return add_factor();
    if (what < 40) return set_value();
    if (what < 46) return fix();
    if (what < 50) return restrict();
    if (what < 56) return set_first_estimate();
    if (what < 60) return add_prior();
    if (what < 66) return set_loss();
    if (what < 76) return remove_factor();
    if (what < (grows ? 80 : 86)) return remove_variable();
    if (what < 88) return replace_variable();
    if (what < 91) return come_and_go();
    if (what < 97) return adopt();
    refused();
  }
  int below(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }

 private:
  double number() { return std::normal_distribution<double>()(random_); }
  Point3d point() { return {{{number(), number(), number()}}}; }
  Pose3d pose() { return Pose3d{}.plus(Vec6d{{number(), number(), number(), number(), number(), number()}}); }
  Loss loss() { return below(3) == 0 ? Loss::none() : below(2) ? Huber(1.0 + below(9)) : Cauchy(1.0 + below(9)); }
  std::array<double, 8> value_of(const VariableOps* ops) {
    std::array<double, 8> out{};
    const Pose3d x = pose();
    const Point3d p = point();
    std::memcpy(out.data(), ops == &kVariableOps<Pose3d> ? static_cast<const void*>(&x) : &p, ops->bytes);
    return out;
  }
  template <class T>
  const T& any(const std::vector<T>& v) {
    return v[static_cast<std::size_t>(below(static_cast<int>(v.size())))];
  }
  // Null if there is none of the type.
  template <class V>
  const ModelVariable* any_of() {
    const std::size_t from = static_cast<std::size_t>(below(static_cast<int>(model.variables.size())));
    for (std::size_t i = 0; i < model.variables.size(); ++i) {
      const ModelVariable& v = model.variables[(from + i) % model.variables.size()];
      if (v.ops == &kVariableOps<V>) return &v;
    }
    return nullptr;
  }
  template <class V>
  static VariableId<V> id_of(const ModelVariable& v) {
    return {v.id.key};
  }

  void apply(GraphEdit& edit) {
    const auto ok = graph.apply(edit);
    if (!ok) error_ = "refused: " + ok.error().message;
  }

  template <class V>
  void add(GraphEdit& edit, const V& value) {
    ModelVariable v;
    if (below(3) == 0) v.label = below(1000);
    v.id = edit.add(value, v.label < 0 ? Label() : Label("x", v.label));
    v.ops = &kVariableOps<V>;
    std::memcpy(v.value.data(), &value, sizeof(V));
    v.added = graph.version() + 1;
    v.fixed = below(4) == 0;
    if (v.fixed) v.flagged = v.added;
    if (v.fixed) edit.fix(v.id);
    if (below(6) == 0) v.freedom = freedom(), v.restricted = v.added, edit.set(v.id, v.freedom);
    model.variables.push_back(v);
    ++counts_.added;
  }
  void add_any(GraphEdit& edit) { below(2) ? add(edit, pose()) : add(edit, point()); }

  void note(FactorId id, std::vector<VariableKey> variables, const Loss& loss) {
    model.factors.push_back({id, std::move(variables), loss, graph.version() + 1, 0});
  }

  void add_variable() {
    GraphEdit edit = graph.edit();
    add_any(edit);
    apply(edit);
  }

  void add_factor() {
    GraphEdit edit = graph.edit();
    const ModelVariable *a = any_of<Pose3d>(), *b = any_of<Pose3d>(), *p = any_of<Point3d>();
    const Loss l = loss();
    const int kind = below(4);
    if (kind == 0 && a != nullptr && p != nullptr)
      note(edit.add(SeenPoint{{{1, 2, 3}}}, Sigma(0.5), l, id_of<Pose3d>(*a), id_of<Point3d>(*p)), {a->id, p->id}, l);
    else if (kind == 1 && a != b)
      note(edit.add(Between{pose()}, Sigma(0.5), l, id_of<Pose3d>(*a), id_of<Pose3d>(*b)), {a->id, b->id}, l);
    else if (kind == 2 && p != nullptr)
      note(edit.add(Prior{point()}, Sigma(0.5), l, id_of<Point3d>(*p)), {p->id}, l);
    else if (a != nullptr)
      note(edit.add(Prior{pose()}, Sigma(0.5), l, id_of<Pose3d>(*a)), {a->id}, l);
    apply(edit);
  }

  // Through the edit's columns, as replicas and marginalization do it for first estimates.
  void write(edit::SetKind kind) {
    GraphEdit edit = graph.edit();
    ModelVariable& v = *model.find(any(model.variables).id);
    const std::array<double, 8> value = value_of(v.ops);
    edit::Variables& c = edit.variables(v.ops);
    c.set.emplace_back(v.id.key, kind);
    c.set_values.push_back(value.data());
    apply(edit);
    if (kind == edit::SetKind::value) {
      v.value = value;
      v.set = graph.version();
    } else {
      v.first = value;
      v.has_first = true;
      v.first_set = graph.version();
    }
  }
  void set_value() { write(edit::SetKind::value), ++counts_.set; }
  void set_first_estimate() { write(edit::SetKind::first_estimate), ++counts_.estimates; }

  void fix() {
    GraphEdit edit = graph.edit();
    ModelVariable& v = *model.find(any(model.variables).id);
    const bool fixed = below(2) == 0;
    edit.fix(v.id, fixed);
    apply(edit);
    ++(fixed == v.fixed ? counts_.raised_nothing : counts_.flagged);
    if (fixed != v.fixed) v.flagged = graph.version();  // C6
    v.fixed = fixed;
  }

  // Of poses and points alike.
  Freedom freedom() {
    const Freedom::Axes axes = below(2) ? Freedom::Axes::world : Freedom::Axes::body;
    return Freedom::hold({below(3)}, axes);
  }

  void restrict() {
    GraphEdit edit = graph.edit();
    ModelVariable& v = *model.find(any(model.variables).id);
    const Freedom wanted = below(3) == 0 ? Freedom::full() : below(3) == 0 ? v.freedom : freedom();
    if (below(4) == 0) edit.set(v.id, freedom());  // of one that is named twice the last holds
    edit.set(v.id, wanted);
    const bool told = edit.variables(v.ops).freedoms.front().second != v.freedom || wanted != v.freedom;
    apply(edit);
    ++(told ? counts_.restricted : counts_.raised_nothing);
    if (told) v.restricted = graph.version();  // C6
    v.freedom = wanted;
  }

  void set_loss() {
    std::vector<std::size_t> weighable;
    for (std::size_t i = 0; i < model.factors.size(); ++i)
      if (!GraphModel::is_prior(model.factors[i])) weighable.push_back(i);
    if (weighable.empty()) return;
    GraphEdit edit = graph.edit();
    ModelFactor& f = model.factors[any(weighable)];
    f.loss = loss();
    edit.set(f.id, f.loss);
    apply(edit);
    f.weighed = graph.version();
    ++counts_.losses;
  }

  void add_prior() {
    GraphEdit edit = graph.edit();
    LinearPrior prior;
    std::vector<VariableKey> variables;
    for (int k = 0; k < 3; ++k) {
      ModelVariable& v = *model.find(any(model.variables).id);
      if (std::find(variables.begin(), variables.end(), v.id) != variables.end()) continue;
      variables.push_back(v.id);
      const std::size_t at = prior.estimates.size();
      prior.estimates.insert(prior.estimates.end(), v.value.begin(),
                             v.value.begin() + static_cast<std::ptrdiff_t>(estimate_doubles(*v.ops)));
      prior.cols += v.ops->dim;
      if (v.has_first) continue;
      std::copy(prior.estimates.begin() + static_cast<std::ptrdiff_t>(at), prior.estimates.end(), v.first.begin());
      v.has_first = true;
      v.first_set = graph.version() + 1;
    }
    prior.variables = variables;
    prior.rows = prior.cols;
    for (int i = 0; i < prior.rows; ++i) prior.d.push_back(number());
    for (int i = 0; i < prior.rows * prior.cols; ++i) prior.R.push_back(number());
    note(edit.add(prior), variables, Loss::none());
    apply(edit);
    ++counts_.priors;
  }

  void remove_factor() {
    if (model.factors.empty()) return;
    GraphEdit edit = graph.edit();
    const std::size_t i = static_cast<std::size_t>(below(static_cast<int>(model.factors.size())));
    edit.remove(model.factors[i].id);
    model.factors.erase(model.factors.begin() + static_cast<std::ptrdiff_t>(i));
    apply(edit);
    ++counts_.removed;
  }

  // Its factors go with it; a linear prior goes on without it, as another one.
  void forget(const VariableKey& id) {
    std::erase_if(model.variables, [&](const ModelVariable& v) { return v.id == id; });
    std::vector<ModelFactor> rest;
    for (ModelFactor& f : model.factors) {
      if (!GraphModel::is_prior(f) || !GraphModel::touches(f, id)) continue;
      std::erase(f.variables, id);
      if (!f.variables.empty()) rest.push_back({FactorId{PriorTable::kKey, {}}, f.variables, Loss::none(), 0, 0});
      f.variables.assign(1, id);
    }
    std::erase_if(model.factors, [&](const ModelFactor& f) { return GraphModel::touches(f, id); });
    std::move(rest.begin(), rest.end(), std::back_inserter(model.factors));
    ++counts_.removed;
  }
  // The ids of the priors that came so are the graph's to choose.
  void name_derived_priors() {
    const PriorTable& table = graph.priors();
    std::uint32_t row = table.extent();
    for (auto f = model.factors.rbegin(); f != model.factors.rend() && row > 0; ++f) {
      if (!GraphModel::is_prior(*f)) continue;
      do --row;
      while (row > 0 && !table.slots().is_live(row));
      if (f->added != 0) break;
      f->id.key = table.slots().key(row);
      f->added = graph.version();
    }
  }

  void remove_variable() {
    GraphEdit edit = graph.edit();
    const VariableKey id = any(model.variables).id;
    edit.remove(id);
    apply(edit);
    forget(id);
    name_derived_priors();
  }

  // One goes and one comes in the same edit: it may well have the same slot.
  void replace_variable() {
    GraphEdit edit = graph.edit();
    const VariableKey id = any(model.variables).id;
    edit.remove(id);
    add_any(edit);
    apply(edit);
    forget(id);
    name_derived_priors();
  }

  // C2: removed, added, removed.
  void come_and_go() {
    remove_variable();
    add_variable();
    GraphEdit edit = graph.edit();
    const VariableKey id = model.variables.back().id;
    edit.remove(id);
    apply(edit);
    forget(id);
    ++counts_.came_and_went;
  }

  void clear() {
    GraphEdit edit = graph.edit();
    for (const ModelVariable& v : model.variables) edit.remove(v.id);
    apply(edit);
    model = {};
    ++counts_.cleared;
  }

  // C5: values of some, found at a version of late.
  void adopt() {
    Solution found;
    const std::uint64_t back = static_cast<std::uint64_t>(below(30));
    found.version = graph.version() - std::min(back, graph.version());
    for (const VariableOps* ops : {&kVariableOps<Pose3d>, &kVariableOps<Point3d>}) {
      Solution::Column &c = found.columns.emplace_back(), &t = taken_.columns[ops == &kVariableOps<Point3d>];
      c.ops = t.ops = ops;
      c.values = t.values = ByteColumn(ops->bytes);
      t.keys.clear();
    }
    for (ModelVariable& v : model.variables) {
      if (below(2)) continue;
      const std::size_t type = v.ops == &kVariableOps<Point3d>;
      const std::array<double, 8> value = value_of(v.ops);
      found.columns[type].keys.push_back(v.id.key);
      found.columns[type].values.push_back(value.data());
      if (v.fixed || std::max(v.added, v.set) > found.version ||
          (!v.freedom.is_full() && v.restricted > found.version)) {
        ++counts_.kept_from_solution;
        continue;
      }
      v.value = value;
      taken_.columns[type].keys.push_back(v.id.key);
      taken_.columns[type].values.push_back(value.data());
    }
    found.columns[0].keys.push_back({9999, 1});  // long gone
    const Pose3d gone;
    found.columns[0].values.push_back(&gone);
    if (!graph.adopt(found)) error_ = "a solution was refused";
    adopted_ = true;
    ++counts_.adopted;
  }

  // Whatever else it says, it changes nothing.
  void refused() {
    GraphEdit edit = graph.edit();
    const ModelVariable& v = any(model.variables);
    edit.remove(any(model.variables).id);
    edit.fix(v.id, !v.fixed);
    edit.set(v.id, freedom());
    edit.add(point());
    switch (below(3)) {
      case 0:
        edit.remove(VariableKey(v.ops->key, SlotKey{v.id.key.index, v.id.key.generation + 1}));
        break;
      case 1:
        edit.add(Point3d{{{std::nan(""), 0, 0}}});
        break;
      default:
        edit.require_version(graph.version() + 1);
    }
    if (graph.apply(edit)) error_ = "an edit that says what cannot be was taken";
    edit.clear();
    ++counts_.refused;
  }

  std::mt19937 random_;
  std::int64_t steps_ = 0;
  Counts counts_;
  std::string error_;
  bool adopted_ = false;
  Solution taken_{0, std::vector<Solution::Column>(2)};
};

}  // namespace oriel::testing_graph
