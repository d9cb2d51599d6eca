// What a config may name: one table for each kind of thing. They are values: a program with a task, a loss or a part of
// a window of its own adds it to a copy, and hands that to whoever reads the config (io/run_config.h).
//
//   RunNames names = shipped_names();
//   if (auto ok = names.losses.add("saturating", {CustomLoss<Saturating>(1.0), "At most c^2."}); !ok) return ok;
#pragma once
#include <memory>
#include <vector>

#include "oriel/run/executor.h"
#include "oriel/run/name_table.h"
#include "oriel/run/setting.h"
#include "oriel/run/window_parts.h"
#include "oriel/solve/engine.h"

namespace oriel {

// NAME:SCALE, or NAME:SCALE:SHAPE where it has a shape; `loss` with another scale and shape.
struct NamedLoss {
  Loss loss;
  const char* sentence;
  bool has_shape = false;
};

// Null `make`: known, but in another program than this.
struct NamedEngine {
  std::unique_ptr<Engine> (*make)(Graph& graph) = nullptr;
  const char* sentence;
};

struct NamedTask {
  const char* sentence;
  const TaskOps* worker = nullptr;  // what runs in a worker: Zygote::start({task.worker})
  // Of a task of one's own: a section of the task's name.
  std::vector<Setting> settings = {};
  AnyOptions defaults = {};
};
// Of a task (run/task.h) whose Config is plain options.
template <Task T>
NamedTask named_task(const char* sentence, std::vector<Setting> settings) {
  return {sentence, &kTaskOps<T>, std::move(settings), AnyOptions(TaskConfig<T>{})};
}

NameTable<NamedLoss> shipped_losses();
NameTable<NamedEngine> shipped_engines();
NameTable<ExecutorKind> shipped_executors();
NameTable<NamedTask> shipped_tasks();

struct RunNames : WindowParts {  // providers, builders, hooks, policies
  NameTable<NamedTask> tasks = shipped_tasks();
  NameTable<ExecutorKind> executors = shipped_executors();
  NameTable<NamedEngine> engines = shipped_engines();
  NameTable<NamedLoss> losses = shipped_losses();
};
// Everything that comes with the library.
inline RunNames shipped_names() { return {}; }

}  // namespace oriel
