// Snapshots: what one thread says now and then, and any number of others read whenever they like. A reader sees one
// whole value that does not change while he looks; he never waits for the writer, nor the writer for him.
//
//     Snapshots<WindowPoses> board;
//     board.publish([&](WindowPoses& out) { out.poses = ...; });    // the owner, after each update
//     const auto now = board.read();                                // any thread: now->poses; not longer than the
//     board
//
// Values are written in place, in slots that nobody reads: a value that keeps its memory asks for none. Whoever holds
// what read() gave keeps its slot; while all slots but the newest are held, publish() says so and leaves the newest as
// it is.
#pragma once
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "oriel/manifold/se3.h"
#include "oriel/window/window_update.h"

namespace oriel {

template <class T>
class Snapshots {
  static constexpr int kNone = -1;
  struct alignas(64) Slot {
    std::atomic<std::int64_t> readers{0};
    T value{};
    std::uint64_t number = 0;
  };

 public:
  explicit Snapshots(int slots = 8) : slots_(static_cast<std::size_t>(slots < 2 ? 2 : slots)) {}

  // What was read; of one thread.
  class Reading {
   public:
    Reading() = default;
    Reading(Reading&& other) noexcept : slot_(std::exchange(other.slot_, nullptr)) {}
    Reading& operator=(Reading&& other) noexcept {
      std::swap(slot_, other.slot_);
      return *this;
    }
    ~Reading() {
      if (slot_ != nullptr) slot_->readers.fetch_sub(1, std::memory_order_release);
    }
    explicit operator bool() const { return slot_ != nullptr; }  // false: nothing was published yet
    const T& operator*() const { return slot_->value; }
    const T* operator->() const { return &slot_->value; }
    std::uint64_t number() const { return slot_->number; }  // 1, 2, ... as they were published

   private:
    friend class Snapshots;
    explicit Reading(Slot* slot) : slot_(slot) {}
    Slot* slot_ = nullptr;
  };

  // A reader counts himself in and looks whether the slot is still the newest: then the writer, who takes none that is
  // the newest or has readers, has seen him or will.
  Reading read() const {
    for (;;) {
      const int newest = newest_.load(std::memory_order_seq_cst);
      if (newest == kNone) return {};
      Slot& slot = slots_[static_cast<std::size_t>(newest)];
      slot.readers.fetch_add(1, std::memory_order_seq_cst);
      if (newest_.load(std::memory_order_seq_cst) == newest) return Reading(&slot);
      slot.readers.fetch_sub(1, std::memory_order_release);
    }
  }

  // One thread alone. fill(T&) is given what stood there long ago. False: every slot is held.
  template <class F>
  bool publish(F&& fill) {
    const int newest = newest_.load(std::memory_order_relaxed);
    for (int i = 0; i < static_cast<int>(slots_.size()); ++i) {
      Slot& slot = slots_[static_cast<std::size_t>(i)];
      if (i == newest || slot.readers.load(std::memory_order_seq_cst) != 0) continue;
      fill(slot.value);
      slot.number = ++number_;
      newest_.store(i, std::memory_order_seq_cst);
      return true;
    }
    return false;
  }

 private:
  mutable std::vector<Slot> slots_;
  std::atomic<int> newest_{kNone};
  std::uint64_t number_ = 0;
};

// The poses of a window's states, oldest first, after an update.
struct WindowPoses {
  struct Pose {
    Time time;
    Pose3d T_world_body;
    bool solved = false;  // else a prediction: it came since
  };
  std::uint64_t version = 0;  // of the graph
  std::vector<Pose> poses;
};

// A listener that publishes them: window.listen(&poses), and any thread reads poses.board().
class WindowPosesBoard final : public WindowListener {
 public:
  explicit WindowPosesBoard(ProviderId provider) : provider_(provider) {}
  const Snapshots<WindowPoses>& board() const { return board_; }
  void updated(const Graph& graph, const States& states, const WindowUpdate&) override {
    board_.publish([&](WindowPoses& out) {
      out.version = graph.version();
      out.poses.clear();
      const int place = states.place_of(provider_, kVariableOps<Pose3d>.key);
      for (const State& s : states.timeline(provider_))
        if (place >= 0)
          out.poses.push_back({s.time, graph.value(VariableId<Pose3d>{s.variables[place].key}), s.solved});
    });
  }

 private:
  ProviderId provider_;
  Snapshots<WindowPoses> board_;
};

}  // namespace oriel
