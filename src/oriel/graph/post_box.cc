#include "oriel/graph/post_box.h"

#include <algorithm>
#include <tuple>

namespace oriel {
namespace {

Error closed() { return {ErrorCode::conflict, "post: nobody takes posts here any more"}; }

}  // namespace

const Result<void>& Receipt::wait() const {
  post_->done.wait(false, std::memory_order_acquire);
  return post_->result;
}

const GraphEdit& Receipt::edit() const {
  check(done(), "Receipt::edit: the post was not taken yet");
  return post_->edit;
}

Receipt PostBox::post(GraphEdit edit, std::uint32_t sender, std::uint64_t stamp) {
  auto post = std::make_shared<detail::Post>();
  post->edit = std::move(edit);
  post->sender = sender;
  post->stamp = stamp;
  if (post->edit.lender() != nullptr) {
    answer(*post, Error{ErrorCode::conflict, "post: the edit's ids were lent by a graph; post a proposal"});
    return Receipt(std::move(post));
  }
  const std::lock_guard lock(mutex_);
  if (closed_) {
    answer(*post, closed());
  } else {
    post->sequence = sequence_++;
    posted_.push_back(post);
  }
  return Receipt(std::move(post));
}

bool PostBox::before(const std::shared_ptr<detail::Post>& a, const std::shared_ptr<detail::Post>& b) {
  return std::tie(a->stamp, a->sender, a->sequence) < std::tie(b->stamp, b->sender, b->sequence);
}

PostBox::Report PostBox::take(Graph& graph, std::uint64_t until) noexcept {
  {
    const std::lock_guard lock(mutex_);
    if (waiting_.empty())
      waiting_.swap(posted_);
    else
      waiting_.insert(waiting_.end(), posted_.begin(), posted_.end());
    posted_.clear();
  }
  std::sort(waiting_.begin(), waiting_.end(), before);
  Report report;
  auto post = waiting_.begin();
  for (; post != waiting_.end() && (*post)->stamp <= until; ++post) {
    Result<void> ok = graph.apply((*post)->edit);
    ++(ok ? report.applied : report.refused);
    answer(**post, std::move(ok));
  }
  waiting_.erase(waiting_.begin(), post);
  report.waiting = static_cast<int>(waiting_.size());
  return report;
}

void PostBox::close() noexcept {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    waiting_.insert(waiting_.end(), posted_.begin(), posted_.end());
    posted_.clear();
  }
  for (const auto& post : waiting_) answer(*post, closed());
  waiting_.clear();
}

// The last that the owner does with a post: from now on it is its sender's.
void PostBox::answer(detail::Post& post, Result<void> result) noexcept {
  post.result = std::move(result);
  post.done.store(true, std::memory_order_release);
  post.done.notify_all();
}

}  // namespace oriel
