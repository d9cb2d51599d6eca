// What the linear algebra asks of threads: run n independent tasks and come back when all are done. The threads
// themselves live in rooms to the right; here a null pool means "on this thread".
#pragma once
#include <type_traits>

namespace oriel {

// A borrowed callable (task, worker): no allocation, valid while the callable lives.
class TaskRef {
 public:
  template <class F>
  requires(!std::is_same_v<std::remove_cvref_t<F>, TaskRef>) TaskRef(F&& f)  // NOLINT: a lambda at the call
      : object_(const_cast<void*>(static_cast<const void*>(&f))), call_([](void* object, int task, int worker) {
          (*static_cast<std::remove_reference_t<F>*>(object))(task, worker);
        }) {}
  void operator()(int task, int worker) const { call_(object_, task, worker); }

 private:
  void* object_;
  void (*call_)(void*, int, int);
};

class TaskPool {
 public:
  virtual ~TaskPool() = default;
  // Number of workers, the caller's thread included; `worker` of a task is in [0, workers()).
  virtual int workers() const = 0;
  // Calls body(task, worker) once for each task in [0, count), in any order and on any worker; returns when all are
  // done. Two tasks that run at the same time have different workers. `body` does not throw.
  virtual void parallel_for(int count, TaskRef body) noexcept = 0;
};

inline void parallel_for(TaskPool* pool, int count, TaskRef body) {
  if (pool != nullptr && count > 1) return pool->parallel_for(count, body);
  for (int task = 0; task < count; ++task) body(task, 0);
}

}  // namespace oriel
