#include "oriel/io/chain_odometry.h"

#include <cstdlib>
#include <utility>

#include "oriel/io/pose_start.h"

namespace oriel {
namespace {

// Edges of each pose, those to its neighbours in the file first: they are odometry where the file has any.
template <class Edge>
class Links {
 public:
  Links(std::size_t poses, const std::vector<Edge>& edges) : begin_(poses + 1, 0) {
    for (const Edge& e : edges) ++begin_[e.from + 1], ++begin_[e.to + 1];
    for (std::size_t i = 0; i < poses; ++i) begin_[i + 1] += begin_[i];
    edges_.resize(2 * edges.size());
    std::vector<std::size_t> at(begin_.begin(), begin_.end() - 1);
    for (const bool consecutive : {true, false})
      for (std::size_t k = 0; k < edges.size(); ++k)
        if ((std::abs(edges[k].from - edges[k].to) == 1) == consecutive)
          edges_[at[edges[k].from]++] = k, edges_[at[edges[k].to]++] = k;
  }
  template <class F>
  void for_each(std::size_t pose, F&& f) const {
    for (std::size_t i = begin_[pose]; i < begin_[pose + 1]; ++i) f(edges_[i]);
  }

 private:
  std::vector<std::size_t> begin_, edges_;
};

template <class Pose, class Edge>
class Chain {
 public:
  Chain(std::size_t count, const std::vector<Edge>& edges, bool shortest)
      : edges_(edges), links_(count, edges), poses_(count), known_(count, 0), shortest_(shortest) {}

  // `held` begin together, then the first pose of every piece that they do not reach. Empty `values`: all are identity.
  std::vector<Pose> from(const std::vector<std::int32_t>& held, const std::vector<Pose>& values) {
    for (auto it = held.rbegin(); it != held.rend(); ++it) begin(*it, values[*it]);  // the first is taken first
    follow();
    for (std::size_t root = 0; root < poses_.size(); ++root) {
      if (known_[root]) continue;
      begin(root, values.empty() ? Pose{} : values[root]);
      follow();
    }
    return std::move(poses_);
  }

 private:
  void begin(std::size_t pose, const Pose& value) {
    poses_[pose] = value;
    known_[pose] = 1;
    if (!shortest_) ahead_.push_back(pose);
    loops_.push_back(pose);
  }

  void follow() {
    while (!ahead_.empty() || next_loop_ < loops_.size()) {
      const bool consecutive = !ahead_.empty();
      const std::size_t at = consecutive ? ahead_.back() : loops_[next_loop_++];
      if (consecutive) ahead_.pop_back();
      links_.for_each(at, [&](std::size_t k) { step(at, edges_[k], consecutive); });
    }
  }

  void step(std::size_t at, const Edge& e, bool consecutive) {
    if (consecutive && std::abs(e.from - e.to) != 1) return;
    const bool forward = static_cast<std::size_t>(e.from) == at;
    const std::size_t other = static_cast<std::size_t>(forward ? e.to : e.from);
    if (known_[other]) return;
    const Pose motion = pose_of(e.measurement);
    begin(other, poses_[at] * (forward ? motion : motion.inverse()));
  }

  const std::vector<Edge>& edges_;
  const Links<Edge> links_;
  std::vector<Pose> poses_;
  std::vector<char> known_;
  std::vector<std::size_t> ahead_, loops_;  // consecutive edges are followed to their end before any other is taken
  std::size_t next_loop_ = 0;
  bool shortest_;  // none is followed to its end
};

// A pose that FIX holds keeps the value that the file gives it: a start must not change the problem.
template <class Pose, class Edge, class FilePose>
std::vector<Pose> chain(const PoseGraphFile& file, const std::vector<Edge>& edges, const std::vector<FilePose>& from,
                        bool shortest) {
  std::vector<Pose> values;
  values.reserve(from.size());
  for (const FilePose& p : from) values.push_back(pose_of(p));
  return Chain<Pose, Edge>(file.ids.size(), edges, shortest)
      .from(values.empty() ? std::vector<std::int32_t>() : file.fixed, values);
}

}  // namespace

std::vector<Pose2d> chain_odometry2(const PoseGraphFile& file, bool shortest) {
  return chain<Pose2d>(file, file.planar_edges, file.planar_poses, shortest);
}

std::vector<Pose3d> chain_odometry3(const PoseGraphFile& file, bool shortest) {
  return chain<Pose3d>(file, file.spatial_edges, file.spatial_poses, shortest);
}

}  // namespace oriel
