// Random operations, three followers of different pace, a model. Long: ORIEL_FUZZ_OPERATIONS=1000000 oriel_test_graph
// --gtest_filter='ChangeLogFuzz.*'; ORIEL_FUZZ_SEED=... alone repeats one run.
#include <gtest/gtest.h>

#include <cstdlib>
#include <set>
#include <tuple>

#include "graph/model_operations.h"
#include "oriel/graph/fingerprint.h"

namespace oriel {
namespace {

using testing_graph::difference, testing_graph::GraphModel, testing_graph::ModelFactor, testing_graph::ModelVariable;
using testing_graph::incidence_difference;
using testing_graph::ModelOperations;

using Name = std::tuple<std::uint64_t, std::uint32_t, std::uint32_t>;  // of a variable or a factor
Name name(std::uint64_t type, SlotKey k) { return {type, k.index, k.generation}; }
Name name(const VariableKey& id) { return name(id.type, id.key); }
Name name(const FactorId& id) { return name(id.table, id.key); }

// What an edit says, or should say, to a follower.
struct News {
  bool whole = false;
  std::vector<Name> added_variables, added_factors;  // in order, of each type
  std::set<Name> removed, reweighed;
  std::set<std::pair<Name, int>> set;
  std::set<std::pair<Name, bool>> fixed;
  std::set<std::tuple<Name, std::uint32_t, Freedom::Axes>> freedoms;
  std::size_t named = 0;  // entries for what sets hold once

  friend bool operator==(const News&, const News&) = default;
};

News news_of(const GraphEdit& edit, const Graph& graph) {
  News out;
  out.whole = edit.whole();
  for (const auto& p : graph.pools()) {
    const edit::Variables* c = edit.find_variables(p->ops().key);
    if (c == nullptr) continue;
    for (const auto& a : c->added) out.added_variables.push_back(name(c->ops->key, a.key));
    for (const SlotKey k : c->removed) out.removed.insert(name(c->ops->key, k));
    for (const auto& [k, kind] : c->set) out.set.insert({name(c->ops->key, k), static_cast<int>(kind)});
    for (const auto& [k, fixed] : c->fixed) out.fixed.insert({name(c->ops->key, k), fixed});
    for (const auto& [k, f] : c->freedoms) out.freedoms.insert({name(c->ops->key, k), f.held, f.axes});
    out.named += c->removed.size() + c->set.size() + c->fixed.size() + c->freedoms.size();
  }
  for (const auto& t : graph.tables())
    for (const auto& c : edit.factor_columns()) {
      if (c->ops->key != t->ops().key) continue;
      for (const auto& a : c->added) out.added_factors.push_back(name(c->ops->key, a.key));
      for (const SlotKey k : c->removed) out.removed.insert(name(c->ops->key, k));
      for (const auto& [k, loss] : c->losses) out.reweighed.insert(name(c->ops->key, k));
      out.named += c->removed.size();
    }
  for (const auto& a : edit.priors().added) out.added_factors.push_back(name(PriorTable::kKey, a.key));
  for (const SlotKey k : edit.priors().removed) out.removed.insert(name(PriorTable::kKey, k));
  out.named += edit.priors().removed.size();
  return out;
}

// A graph that follows, and what it should hold: what is new to it as it is in the origin, the rest as it was.
class Follower {
 public:
  Follower(ModelOperations& origin, int pace) : origin_(origin), pace_(pace), subscription_(origin.graph.subscribe()) {}
  ~Follower() { origin_.graph.unsubscribe(subscription_); }

  bool behind() const { return origin_.graph.log().behind(subscription_); }
  std::int64_t looks = 0, wholes = 0, times_behind = 0;

  // After every operation; what is wrong, if anything is.
  std::string follow() {
    if (auto text = check_behind(); !text.empty()) return text;
    if (origin_.below(pace_) > 0) return {};
    if (auto text = look(); !text.empty()) return text;
    if (origin_.taken() != nullptr && origin_.below(2)) take(*origin_.taken());
    return {};
  }

 private:
  // C1, C2, C3, C5, C6: what the model says that it has not heard.
  News expected() const {
    News out;
    out.whole = behind_;
    const GraphModel& now = origin_.model;
    for (const auto& p : origin_.graph.pools())
      for (const ModelVariable& v : now.variables)
        if (v.ops->key == p->ops().key && v.added > seen_) out.added_variables.push_back(name(v.id));
    for (const auto& t : origin_.graph.tables())
      for (const ModelFactor& f : now.factors)
        if (f.id.table == t->ops().key && f.added > seen_) out.added_factors.push_back(name(f.id));
    for (const ModelFactor& f : now.factors)
      if (GraphModel::is_prior(f) && f.added > seen_) out.added_factors.push_back(name(f.id));
    if (behind_) return out;
    for (const ModelVariable& v : now.variables) {
      if (v.added > seen_) continue;
      if (v.set > seen_) out.set.insert({name(v.id), static_cast<int>(edit::SetKind::value)});
      if (v.first_set > seen_) out.set.insert({name(v.id), static_cast<int>(edit::SetKind::first_estimate)});
      if (v.flagged > seen_) out.fixed.insert({name(v.id), v.fixed});
      if (v.restricted > seen_) out.freedoms.insert({name(v.id), v.freedom.held, v.freedom.axes});
    }
    for (const ModelFactor& f : now.factors)
      if (f.added <= seen_ && f.weighed > seen_) out.reweighed.insert(name(f.id));
    for (const ModelVariable& v : view_.variables)
      if (now.find(v.id) == nullptr) out.removed.insert(name(v.id));
    for (const ModelFactor& f : view_.factors)
      if (now.find(f.id) == nullptr) out.removed.insert(name(f.id));
    out.named = out.removed.size() + out.set.size() + out.fixed.size() + out.freedoms.size();
    return out;
  }

  // Entries of the log that nobody but this follower may need.
  std::size_t net() const {
    const News news = expected();
    std::size_t n = news.removed.size() + news.reweighed.size();
    for (const ModelVariable& v : origin_.model.variables) {
      if (v.added > seen_) continue;
      std::set<std::uint64_t> changes;
      for (const std::uint64_t at : {v.set, v.flagged, v.first_set, v.restricted})
        if (at > seen_) changes.insert(at);
      n += changes.size();
    }
    return n;
  }

  // It is dropped where its net has outgrown the bound, for no other reason, and not much later.
  std::string check_behind() {
    if (behind_) return behind() ? "" : "it caught up without a look";
    const Graph& graph = origin_.graph;
    const std::size_t most = graph.log().bound().entries(graph.variable_count() + graph.factor_count());
    if (!behind() && origin_.below(8) > 0) return {};  // the model takes its time
    const std::size_t n = net();
    // An operation may be several edits: what the first of them took may look smaller after the last.
    if (behind() && n + 4 <= most) return "it fell behind with " + std::to_string(n) + " changes";
    if (!behind() && seen_ > 0 && n > 6 * most) return "it should have fallen behind";
    if (!behind()) return {};
    behind_ = true;
    seen_ = 0;
    ++times_behind;
    return {};
  }

  std::string look() {
    origin_.graph.collect(subscription_, edit_);
    const News said = news_of(edit_, origin_.graph);
    if (said != expected()) return "it was told of other things than what had changed";
    if (auto text = check_order(); !text.empty()) return text;
    if (const auto ok = graph_.apply(edit_); !ok) return "it refused its edit: " + ok.error().message;
    ++looks, wholes += said.whole;
    GraphModel now = origin_.model;
    for (ModelVariable& v : now.variables) {
      const ModelVariable* known = behind_ ? nullptr : view_.find(v.id);
      if (known != nullptr && v.set <= seen_) v.value = known->value;  // C5: what engines found is no news
    }
    view_ = std::move(now);
    seen_ = origin_.graph.version(), behind_ = false;
    return compare();
  }

  std::string compare() const {
    if (auto text = difference(graph_, view_); !text.empty()) return text;
    for (std::size_t i = 0; i < view_.variables.size(); ++i)
      if (view_.variables[i].value != origin_.model.variables[i].value) return {};
    return fingerprint(graph_) == fingerprint(origin_.graph) ? "" : "it has other bits";
  }

  // C4: variables before the factors that need them. (That all goes out before anything comes in, apply sees to.)
  std::string check_order() const {
    std::uint64_t next = 0;
    for (const auto& p : origin_.graph.pools())
      if (const edit::Variables* c = edit_.find_variables(p->ops().key))
        for (const auto& a : c->added)
          if (a.order != next++) return "variables are not told of first, in order";
    return {};
  }

  // It is handed what an engine has found, at once.
  void take(Solution solution) {
    solution.version = graph_.version();
    EXPECT_TRUE(graph_.adopt(solution));
    for (const Solution::Column& c : solution.columns)
      for (std::size_t i = 0; i < c.keys.size(); ++i)
        std::memcpy(view_.find(VariableKey(c.ops->key, c.keys[i]))->value.data(), c.values.at(i), c.ops->bytes);
  }

  ModelOperations& origin_;
  int pace_;
  Subscription subscription_;
  Graph graph_;
  GraphEdit edit_;
  GraphModel view_;
  std::uint64_t seen_ = 0;
  bool behind_ = false;
};

// One run: its followers, one of which leaves now and then, and another comes.
class Followed {
 public:
  explicit Followed(unsigned seed) : origin(seed) {
    origin.graph.bound_log({.per_live = 0.7, .least = 24});
    for (const int pace : {1, 9, 120}) followers.push_back(std::make_unique<Follower>(origin, pace));
  }

  std::string step(std::int64_t i) {
    const std::size_t before = origin.graph.log().entries();
    origin.step();
    if (!origin.error().empty()) return origin.error();
    if (auto text = difference(origin.graph, origin.model); !text.empty()) return "origin: " + text;
    if (origin.taken() != nullptr && origin.graph.log().entries() != before) return "a solution raised a flag";  // C5
    const ChangeLog& log = origin.graph.log();
    const std::size_t live = origin.graph.variable_count() + origin.graph.factor_count();
    if (log.entries() > 2 * followers.size() * log.bound().entries(live)) return "the log has outgrown its bound";
    for (std::size_t k = 0; k < followers.size(); ++k)
      if (auto text = followers[k]->follow(); !text.empty()) return "follower " + std::to_string(k + 1) + ": " + text;
    if (i % 64 == 0) return incidence_difference(origin.graph, origin.model);
    if (origin.below(3000) == 0) followers[1] = std::make_unique<Follower>(origin, 9);
    return {};
  }

  ModelOperations origin;
  std::vector<std::unique_ptr<Follower>> followers;
};

std::int64_t from_environment(const char* variable, std::int64_t otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::atoll(text);
}

// C1, C2, C3, C4, C5, C6
TEST(ChangeLogFuzz, KeepsThreeFollowersInStepUnderRandomOperations) {
  const std::int64_t wanted = from_environment("ORIEL_FUZZ_OPERATIONS", 30000);
  const std::int64_t seed = from_environment("ORIEL_FUZZ_SEED", -1);
  std::int64_t looks = 0, wholes = 0, behind = 0, done = 0;
  ModelOperations::Counts all;
  for (unsigned run = seed < 0 ? 1 : static_cast<unsigned>(seed); done < wanted; ++run) {
    Followed r(run);
    for (std::int64_t i = 0; i < 10000; ++i, ++done)
      if (const std::string text = r.step(i); !text.empty())
        FAIL() << "seed " << run << ", operation " << i << ": " << text;
    for (const auto& f : r.followers) looks += f->looks, wholes += f->wholes, behind += f->times_behind;
    EXPECT_LE(r.followers[0]->times_behind, r.origin.counts().cleared);  // then the whole, nothing, is less
    EXPECT_GT(r.followers[2]->times_behind, 0) << "seed " << run;
    const ModelOperations::Counts& c = r.origin.counts();
    all.added += c.added, all.removed += c.removed, all.set += c.set, all.flagged += c.flagged;
    all.raised_nothing += c.raised_nothing, all.estimates += c.estimates, all.priors += c.priors;
    all.restricted += c.restricted, all.losses += c.losses, all.came_and_went += c.came_and_went,
        all.adopted += c.adopted;
    all.kept_from_solution += c.kept_from_solution, all.refused += c.refused, all.cleared += c.cleared;
    if (seed >= 0) break;
  }
  std::cout << done << " operations: " << all.added << " variables added, " << all.removed << " things removed, "
            << all.set << " values, " << all.flagged << " flags (" << all.raised_nothing << " as they were), "
            << all.restricted << " freedoms, " << all.estimates << " first estimates, " << all.losses << " losses set, "
            << all.priors << " priors, " << all.came_and_went << " removed-added-removed, " << all.adopted
            << " solutions (" << all.kept_from_solution << " values kept from them), " << all.refused
            << " edits refused, " << all.cleared << " times all removed; " << looks << " looks, " << behind
            << " times behind, " << wholes << " wholes taken\n";
  for (const std::int64_t n : {all.raised_nothing, all.restricted, all.came_and_went, all.kept_from_solution,
                               all.refused, all.cleared, wholes})
    EXPECT_GT(n, 0);
}

}  // namespace
}  // namespace oriel
