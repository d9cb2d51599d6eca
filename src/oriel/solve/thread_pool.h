// The threads of one solver: made once. Between the rounds of a stage they stay awake for a moment, else they sleep.
#pragma once
#include "oriel/base/owned.h"
#include "oriel/linear/task_pool.h"

namespace oriel {

class ThreadPool final : public TaskPool {
 public:
  explicit ThreadPool(int workers);  // the caller's thread is one of them
  ~ThreadPool() override;
  int workers() const override;
  void parallel_for(int count, TaskRef body) noexcept override;

 private:
  struct State;
  Owned<State> state_;
};

}  // namespace oriel
