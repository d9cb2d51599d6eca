#include "oriel/io/gtsam_import.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <system_error>
#include <utility>

#include "oriel/io/camera_frame.h"
#include "oriel/io/text.h"
#include "oriel/manifold/so3.h"

namespace oriel {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMostPoses = 10'000'000;
Time time_of(std::int64_t pose) { return {pose * 100'000'000}; }

// Lines of numbers, some of which are whole, and what a message needs.
class Table {
 public:
  Table(std::string_view text, std::string file_name) : scanner_(text), file_name_(std::move(file_name)) {}

  bool next_line() { return ok_ && scanner_.next_line(); }
  bool ok() const { return ok_; }
  const Error& error() const { return error_; }
  bool fail(const std::string& message) {
    if (ok_) error_ = {ErrorCode::bad_input, message, file_name_, std::max<std::int64_t>(1, scanner_.line())};
    ok_ = false;
    return false;
  }
  bool whole(const char* what, std::int64_t least, std::int64_t most, std::int64_t& out) {
    const NumberFault fault = scanner_.integer(out);
    if (fault != NumberFault::none) return fail(describe_number(fault, "a whole number", what, scanner_.token()));
    return (out >= least && out <= most) ||
           fail("expected " + std::to_string(least) + " to " + std::to_string(most) + " for " + what);
  }
  template <std::size_t N>
  bool numbers(const char* what, std::array<double, N>& out) {
    for (double& x : out) {
      const NumberFault fault = scanner_.number(x);
      if (fault != NumberFault::none) return fail(describe_number(fault, "a finite number", what, scanner_.token()));
    }
    return scanner_.at_end_of_line() || fail("expected the end of the line, found " + quote_token(scanner_.token()));
  }

 private:
  TextScanner scanner_;
  std::string file_name_;
  bool ok_ = true;
  Error error_;
};

Result<void> read_calibration(Table& table, Recording& out) {
  std::array<double, 6> k{};  // fx fy s cx cy b
  if (!table.next_line()) table.fail("expected fx fy s cx cy b, found nothing");
  if (table.ok()) table.numbers("the calibration", k);
  if (table.ok() && !(k[0] > 0 && k[1] > 0 && k[2] == 0 && k[5] > 0))
    table.fail("expected positive focal lengths and baseline, and no skew");
  if (!table.ok()) return table.error();
  out.cameras.resize(2);
  for (RecordedCamera& c : out.cameras) c.fx = k[0], c.fy = k[1], c.cx = k[3], c.cy = k[4];
  out.cameras[1].p_body_camera[0] = k[5];
  return {};
}

struct Sighting {
  std::int64_t pose;
  RecordedObservation seen;
};
bool before(const Sighting& a, const Sighting& b) {
  return std::pair(a.pose, a.seen.track_id) < std::pair(b.pose, b.seen.track_id);
}

Result<void> read_factors(Table& table, Recording& out) {
  std::vector<Sighting> rows;
  while (table.next_line()) {
    Sighting s{};
    std::array<double, 6> n{};  // uL uR v X Y Z
    if (table.whole("the pose", 0, kMostPoses, s.pose) &&
        table.whole("the landmark", INT64_MIN, INT64_MAX, s.seen.track_id) && table.numbers("the sighting", n)) {
      s.seen = {s.seen.track_id, n[0], n[2], true, n[1], n[2]};
      rows.push_back(s);
    }
  }
  if (rows.empty()) table.fail("expected pose landmark uL uR v X Y Z, found nothing");
  if (!table.ok()) return table.error();
  std::sort(rows.begin(), rows.end(), before);
  for (const Sighting& s : rows) {
    if (out.frames.empty() || out.frames.back().number != s.pose)
      out.frames.push_back({time_of(s.pose), s.pose, out.observations.size(), 0});
    else if (out.observations.back().track_id == s.seen.track_id)
      table.fail("expected each landmark once a pose, found " + std::to_string(s.seen.track_id) + " again in pose " +
                 std::to_string(s.pose));
    ++out.frames.back().count;
    out.observations.push_back(s.seen);
  }
  if (!table.ok()) return table.error();
  return {};
}

Result<void> read_poses(Table& table, Recording& out) {
  std::int64_t last = -1;
  while (table.next_line()) {
    std::int64_t pose = 0;
    std::array<double, 16> n{};
    RecordedCamera frame;  // for its rotation, made orthonormal
    if (!table.whole("the pose", last + 1, kMostPoses, pose) || !table.numbers("T_world_camera", n)) break;
    if (!io_detail::set_camera_frame({n.begin(), n.end()}, frame)) table.fail("expected rows of [R | p], a rotation R");
    const Rot3d q = Rot3d::from_matrix(frame.R_body_camera);
    out.groundtruth.push_back({time_of(pose), frame.p_body_camera, q.qx, q.qy, q.qz, q.qw});
    last = pose;
  }
  if (!table.ok()) return table.error();
  return {};
}

}  // namespace

Result<Recording> read_gtsam_stereo(const std::string& folder) {
  fs::path root(folder);
  if (!root.has_filename()) root = root.parent_path();
  Recording recording;
  std::error_code code;
  recording.name = fs::absolute(root, code).lexically_normal().filename().string();
  recording.origin = "stereo example of GTSAM, read from the folder " + recording.name;
  using Read = Result<void> (*)(Table&, Recording&);
  const std::pair<const char*, Read> files[] = {{kGtsamCalibration, read_calibration},
                                                {"VO_stereo_factors00s.txt", read_factors},
                                                {"VO_camera_poses00s.txt", read_poses}};
  for (const auto& [name, read] : files) {
    const std::string path = (root / name).string();
    if (read == read_poses && !fs::exists(path, code)) break;
    const Result<std::string> text = read_text_file(path);
    if (!text) return text.error();
    Table table(*text, path);
    if (auto ok = read(table, recording); !ok) return ok.error();
  }
  return recording;
}

}  // namespace oriel
