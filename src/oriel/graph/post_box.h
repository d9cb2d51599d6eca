// Edits from other threads, for a graph that has one writer (decision 16): others post, the owner takes what was posted
// between two solves. What is posted while a solve runs is never lost (C3): it waits, and the solve's values, adopted
// before it is taken, do not overwrite it.
//
// Threads: post() and everything of a Receipt may be called from any thread, at any time; waiting for the box takes as
// long as pushing one pointer, never as long as a solve. take(), and the graph, belong to the owner's thread.
//
// Order: by stamp, then by sender, then as each sender posted: a function of what was posted and not of who came first.
// So the graph is the same, to the bit, whatever the threads did, if at each take(graph, until) all posts with stamps
// up to `until` are there: the owner knows by its data how far its senders are (as with measurements), or waits for
// them.
//
// Errors: each post is an edit of its own, whole or not at all. A refused one changes nothing and is in nobody's way;
// its sender is told by the receipt, the owner by the report.
#pragma once
#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "oriel/graph/graph.h"

namespace oriel {

namespace detail {
struct Post {
  GraphEdit edit;
  std::uint64_t stamp = 0, sequence = 0;
  std::uint32_t sender = 0;
  Result<void> result;
  std::atomic<bool> done{false};
};
}  // namespace detail

// What became of a post.
class Receipt {
 public:
  bool done() const { return post_->done.load(std::memory_order_acquire); }
  // Waits until the owner has taken the post, or closed the box. Not to be called by the owner.
  const Result<void>& wait() const;
  // Once done: the edit as it was applied. It tells the ids of what it added (GraphEdit::resolved).
  const GraphEdit& edit() const;

 private:
  friend class PostBox;
  explicit Receipt(std::shared_ptr<detail::Post> post) : post_(std::move(post)) {}
  std::shared_ptr<detail::Post> post_;
};

class PostBox {
 public:
  struct Report {
    int applied = 0, refused = 0;
    int waiting = 0;  // with later stamps
  };

  PostBox() = default;
  PostBox(const PostBox&) = delete;  // senders hold its address
  PostBox& operator=(const PostBox&) = delete;
  ~PostBox() { close(); }

  // The edit is a proposal (GraphEdit::proposal()), which has placeholders for what it adds and names existing things
  // by their ids: it needs no look at the graph. One that was lent by a graph is refused: lending is the writer's.
  // `sender` and `stamp` (say, a time in ns) are the caller's choice; two threads that post as one sender are ordered
  // by chance.
  Receipt post(GraphEdit edit, std::uint32_t sender = 0, std::uint64_t stamp = 0);

  // Applies what was posted with stamps up to `until`, and asks for no memory beyond what the edits and the graph need.
  Report take(Graph& graph, std::uint64_t until = ~std::uint64_t{0}) noexcept;

  // What waits, and what is posted from now on, is answered with an error.
  void close() noexcept;

 private:
  using Posts = std::vector<std::shared_ptr<detail::Post>>;
  static void answer(detail::Post& post, Result<void> result) noexcept;
  static bool before(const std::shared_ptr<detail::Post>& a, const std::shared_ptr<detail::Post>& b);

  Posts waiting_;  // the owner's
  std::mutex mutex_;
  // ---- guarded by mutex_ ----
  Posts posted_;
  std::uint64_t sequence_ = 0;
  bool closed_ = false;
};

}  // namespace oriel
