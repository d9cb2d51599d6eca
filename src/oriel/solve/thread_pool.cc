#include "oriel/solve/thread_pool.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>
#include <vector>

#include "oriel/base/spin.h"

namespace oriel {
namespace {

// How long a worker looks for the next round before it sleeps. Waking one takes tens of microseconds, as much as many
// a round lasts; between the rounds of a step there is less than this, after a solve it is soon over.
constexpr std::chrono::microseconds kSpin{100};

}  // namespace

// A round is open from its begin until its tasks are given out. Who comes in while it is open takes tasks; who comes
// late goes back to wait, and nobody waits for him.
struct ThreadPool::State {
  static constexpr std::uint64_t kOpen = std::uint64_t{1} << 32, kInside = kOpen - 1;
  std::atomic<std::uint64_t> gate{0};             // kOpen, and how many workers are inside
  std::atomic<std::uint32_t> round{0}, ended{0};  // to sleep on: a round began, the last worker left one
  std::atomic<bool> stop{false};
  const TaskRef* body = nullptr;  // of the open round
  int count = 0;
  // Of every workers-th task, who takes the next one: each worker begins with its own, so that the same task of another
  // round over the same data finds it in the same cache, and goes on with what others left.
  struct alignas(64) Next {
    std::atomic<int> step{0};
  };
  std::vector<Next> next;
  std::vector<std::thread> threads;

  void drain(int worker) {
    const TaskRef& task_body = *body;
    const int n = count, all = static_cast<int>(next.size());
    for (int k = 0; k < all; ++k) {
      const int list = (worker + k) % all;
      std::atomic<int>& step = next[static_cast<std::size_t>(list)].step;
      for (int task = step.fetch_add(1) * all + list; task < n; task = step.fetch_add(1) * all + list)
        task_body(task, worker);
    }
  }
  bool enter() {
    std::uint64_t seen = gate.load();
    while ((seen & kOpen) != 0)
      if (gate.compare_exchange_weak(seen, seen + 1)) return true;
    return false;
  }
  void leave() {
    if (gate.fetch_sub(1) != 1) return;  // the round is open, or others are inside
    ended.fetch_add(1);
    ended.notify_one();
  }
  void work(int worker) {
    for (std::uint32_t seen = 0;;) {
      if (!spin_until(kSpin, {}, [&] { return round.load() != seen; })) round.wait(seen);
      seen = round.load();
      if (stop.load()) return;
      if (!enter()) continue;
      drain(worker);
      leave();
    }
  }
  void begin_round() {
    round.fetch_add(1);
    round.notify_all();
  }
  void wait_until_empty() {
    auto empty = [&] { return (gate.load() & kInside) == 0; };
    if (spin_until(kSpin, {}, empty)) return;
    for (;;) {
      const std::uint32_t before = ended.load();
      if (empty()) return;
      ended.wait(before);
    }
  }
};

ThreadPool::ThreadPool(int workers) : state_(make_owned<State>()) {
  state_->next = std::vector<State::Next>(static_cast<std::size_t>(workers < 1 ? 1 : workers));
  for (int i = 1; i < workers; ++i) state_->threads.emplace_back([s = state_.get(), i] { s->work(i); });
}

ThreadPool::~ThreadPool() {
  state_->stop = true;
  state_->begin_round();
  for (std::thread& t : state_->threads) t.join();
}

int ThreadPool::workers() const { return static_cast<int>(state_->threads.size()) + 1; }

void ThreadPool::parallel_for(int count, TaskRef body) noexcept {
  State& s = *state_;
  if (s.threads.empty() || count < 2) {
    for (int task = 0; task < count; ++task) body(task, 0);
    return;
  }
  s.body = &body;
  s.count = count;
  for (State::Next& n : s.next) n.step = 0;
  s.gate.fetch_or(State::kOpen);
  s.begin_round();
  s.drain(0);
  s.gate.fetch_and(~State::kOpen);
  s.wait_until_empty();
}

}  // namespace oriel
