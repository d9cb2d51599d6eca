#include "oriel/solve/thread_pool.h"

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

namespace oriel {

struct ThreadPool::State {
  std::mutex mutex;
  std::condition_variable wake, done;
  const TaskRef* body = nullptr;
  int count = 0, busy = 0;
  std::uint64_t round = 0;
  bool stop = false;
  std::atomic<int> next{0};
  std::vector<std::thread> threads;

  void drain(const TaskRef& body_now, int n, int worker) {
    for (int task = next.fetch_add(1); task < n; task = next.fetch_add(1)) body_now(task, worker);
  }
  void work(int worker) {
    std::uint64_t seen = 0;
    std::unique_lock lock(mutex);
    for (;;) {
      wake.wait(lock, [&] { return stop || round != seen; });
      if (stop) return;
      seen = round;
      const TaskRef* b = body;
      const int n = count;
      lock.unlock();
      drain(*b, n, worker);
      lock.lock();
      if (--busy == 0) done.notify_one();
    }
  }
};

ThreadPool::ThreadPool(int workers) : state_(make_owned<State>()) {
  for (int i = 1; i < workers; ++i) state_->threads.emplace_back([s = state_.get(), i] { s->work(i); });
}

ThreadPool::~ThreadPool() {
  {
    std::lock_guard lock(state_->mutex);
    state_->stop = true;
  }
  state_->wake.notify_all();
  for (std::thread& t : state_->threads) t.join();
}

int ThreadPool::workers() const { return static_cast<int>(state_->threads.size()) + 1; }

void ThreadPool::parallel_for(int count, TaskRef body) noexcept {
  State& s = *state_;
  if (s.threads.empty() || count < 2) {
    for (int task = 0; task < count; ++task) body(task, 0);
    return;
  }
  {
    std::lock_guard lock(s.mutex);
    s.body = &body;
    s.count = count;
    s.busy = static_cast<int>(s.threads.size());
    s.next = 0;
    ++s.round;
  }
  s.wake.notify_all();
  s.drain(body, count, 0);
  std::unique_lock lock(s.mutex);
  s.done.wait(lock, [&] { return s.busy == 0; });
}

}  // namespace oriel
