// sync: what it costs the native engine to follow a large graph of which a little changes, stage by stage, beside what
// a first sync costs. A drive of poses (SE(2)) in laps: each pose is tied to the one before, and now and then to one
// that stood near in the lap before.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "oriel/linear/linearize.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace oriel::benchmark {
namespace {

constexpr int kLap = 400;  // poses

template <class Pose = Pose2d>
struct Drive {
  Graph graph;
  std::vector<VariableId<Pose>> poses;  // live, in the order in which they came
  std::uint64_t random = 1;

  int below(int n) {
    random = random * 6364136223846793005u + 1442695040888963407u;
    return static_cast<int>((random >> 33) % static_cast<std::uint64_t>(n));
  }
  void add_newest(int n) {
    GraphEdit edit = graph.edit();
    for (int i = 0; i < n; ++i) {
      const auto x = edit.add(Pose{});
      const std::size_t at = poses.size();
      if (at == 0) edit.add(Prior{Pose{}}, Sigma(0.1), x);
      if (at > 0) edit.add(Between{Pose{}}, Sigma(0.1), poses.back(), x);
      if (at > kLap + 5 && below(3) == 0)
        edit.add(Between{Pose{}}, Sigma(0.1), poses[at - kLap - static_cast<std::size_t>(below(5))], x);
      poses.push_back(x);
    }
    check(graph.apply(edit).ok(), "an edit was refused");
  }
  void remove_newest(int n) {
    GraphEdit edit = graph.edit();
    for (; n > 0; --n) {
      edit.remove(poses.back());
      poses.pop_back();
    }
    check(graph.apply(edit).ok(), "an edit was refused");
  }
  void set_losses(int n) {
    GraphEdit edit = graph.edit();
    for (const auto& t : graph.tables())
      for (std::uint32_t r = 0; r < t->extent(); ++r)
        if (t->slots().is_live(r) && static_cast<int>(r) % 100 == n % 100)
          edit.set(FactorId{t->ops().key, t->slots().key(r)}, Huber(1.0 + n));
    check(graph.apply(edit).ok(), "an edit was refused");
  }
  // Somewhere: n loops are closed anew, n factors that were there go.
  void change_anywhere(int n) {
    GraphEdit edit = graph.edit();
    const auto found = std::find_if(graph.tables().begin(), graph.tables().end(),
                                    [](const auto& t) { return t->ops().residual == Between<Pose>::kName; });
    const FactorTable& table = **found;
    std::vector<std::uint32_t> rows;
    for (int i = 0; i < n; ++i) rows.push_back(static_cast<std::uint32_t>(below(static_cast<int>(table.extent()))));
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    for (const std::uint32_t r : rows)
      if (table.slots().is_live(r) && table.slots().serial(r) % 4 == 0)
        edit.remove(FactorId{table.ops().key, table.slots().key(r)});
    for (int i = 0; i < n / 4; ++i) {
      const std::size_t at = static_cast<std::size_t>(below(static_cast<int>(poses.size()) - kLap));
      edit.add(Between{Pose{}}, Sigma(0.1), poses[at], poses[at + kLap - 3]);
    }
    check(graph.apply(edit).ok(), "an edit was refused");
  }
};

double milliseconds(const std::function<void()>& f) {
  const auto from = std::chrono::steady_clock::now();
  f();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - from).count();
}

struct Cost {
  double engine = 0, structure = 0, order = 0, symbolic = 0, packed = 0;
};

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v[v.size() / 2];
}

// A sync by `engine`, which followed so far; the part of it that builds a structure, by one that followed as well; and
// of that the larger stages once more, apart.
Cost measure(const Graph& graph, NativeEngine& engine, LinearStructure& structure, EliminationOrder& elimination,
             Linearizer& linearizer) {
  Cost c;
  c.engine = milliseconds([&] { check(engine.sync().ok(), "no sync"); });
  const std::int64_t analyses = structure.factorization().analyses();
  const std::uint64_t made = elimination.made;
  c.structure = milliseconds([&] { check(structure.build(graph, {}, elimination).ok(), "no structure"); });
  MinimumDegree degree;
  std::vector<int> order;
  degree.order(structure.pattern(), order);
  c.order = milliseconds([&] { degree.order(structure.pattern(), order); });
  Symbolic symbolic;
  symbolic.analyze(structure.pattern(), order);
  c.symbolic = milliseconds([&] { symbolic.analyze(structure.pattern(), order); });
  if (elimination.made == made) c.order = 0.0;                             // kept
  if (structure.factorization().analyses() == analyses) c.symbolic = 0.0;  // kept, or followed
  Point point;
  point.take(graph);
  ActiveSet active;
  c.packed = milliseconds([&] { linearizer.evaluate(graph, structure, point, nullptr, active, nullptr); });
  c.packed -= milliseconds([&] { linearizer.evaluate(graph, structure, point, nullptr, active, nullptr); });
  return c;
}

struct Row {
  const char* what;
  std::vector<double> engine{}, structure{}, order{}, symbolic{}, packed{};
  void add(const Cost& c) {
    engine.push_back(c.engine), structure.push_back(c.structure), packed.push_back(c.packed);
    order.push_back(c.order), symbolic.push_back(c.symbolic);
  }
  void print(const Row& first) const {
    std::printf("%-44s %8.2f %8.2f %8.2f %8.2f %8.2f   %5.1f %%   %5.1f %%\n", what, median(engine), median(structure),
                median(order), median(symbolic), median(packed), 100.0 * median(engine) / median(first.engine),
                100.0 * median(structure) / median(first.structure));
  }
};

constexpr int kSyncs = 50;
struct Mean {
  double ms = 0.0;
  int orders = 0;
};

// Of many syncs one after the other, those included that make the order anew.
template <class Pose>
Mean mean_of(int variables, bool removes) {
  Drive<Pose> drive;
  NativeEngine engine(drive.graph);
  drive.add_newest(variables);
  check(engine.sync().ok(), "no sync");
  const std::uint64_t made = engine.state().order.made;
  Mean mean;
  for (int i = 0; i < kSyncs; ++i) {
    if (removes && i % 2 == 1)
      drive.remove_newest(variables / 100);
    else
      drive.add_newest(variables / 100);
    mean.ms += milliseconds([&] { check(engine.sync().ok(), "no sync"); }) / kSyncs;
  }
  mean.orders = static_cast<int>(engine.state().order.made - made);
  return mean;
}

template <class Pose>
int run(int variables, int runs) {
  const int change = variables / 100;
  Row first{"first sync"}, grown{"1 % added at the newest end"}, again{"the same again"},
      cut{"1 % removed at the newest end"}, anywhere{"1 % of the factors changed anywhere"},
      losses{"1 % of the losses set"};
  for (int i = 0; i < runs; ++i) {
    Drive<Pose> drive;
    drive.random = static_cast<std::uint64_t>(i) + 1;
    drive.add_newest(variables);
    NativeEngine engine(drive.graph);
    LinearStructure structure;
    EliminationOrder elimination;
    Linearizer linearizer;
    first.add(measure(drive.graph, engine, structure, elimination, linearizer));
    drive.add_newest(change);
    grown.add(measure(drive.graph, engine, structure, elimination, linearizer));
    for (int more = 0; more < 3; ++more) {
      drive.add_newest(change);
      again.add(measure(drive.graph, engine, structure, elimination, linearizer));
    }
    drive.remove_newest(change);
    cut.add(measure(drive.graph, engine, structure, elimination, linearizer));
    drive.change_anywhere(2 * change);
    anywhere.add(measure(drive.graph, engine, structure, elimination, linearizer));
    drive.set_losses(i);
    losses.add(measure(drive.graph, engine, structure, elimination, linearizer));
  }
  const double anew = median(first.engine);
  Mean growing = mean_of<Pose>(variables, false), in_turn = mean_of<Pose>(variables, true);
  std::printf("%d variables, medians of %d runs [ms]\n%-44s %8s %8s %8s %8s %8s   of a first sync, structure\n",
              variables, runs, "", "sync", "struct.", "order", "symbolic", "packing");
  for (const Row* r : {&first, &grown, &again, &cut, &anywhere, &losses}) r->print(first);
  std::printf(
      "means of %d syncs: 1 %% added each time %.2f ms, %.1f %% (the order made anew %d times); added and removed in "
      "turn %.2f ms, %.1f %% (%d times)\n",
      kSyncs, growing.ms, 100.0 * growing.ms / anew, growing.orders, in_turn.ms, 100.0 * in_turn.ms / anew,
      in_turn.orders);
  return 0;
}

}  // namespace
}  // namespace oriel::benchmark

int main(int argc, char** argv) {
  int variables = 100000, runs = 5;
  bool in_space = false;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--variables") == 0) variables = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--runs") == 0) runs = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--poses") == 0) in_space = std::strcmp(argv[i + 1], "se3") == 0;
  }
  if (argc % 2 == 0 || variables < 1000 || runs < 1) {
    std::fprintf(stderr, "sync [--variables N (at least 1000)] [--runs N] [--poses se2|se3]\n");
    return 2;
  }
  return in_space ? oriel::benchmark::run<oriel::Pose3d>(variables, runs)
                  : oriel::benchmark::run<oriel::Pose2d>(variables, runs);
}
