#include "oriel/io/pose_graph_lines.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "oriel/io/text.h"
#include "oriel/manifold/so3.h"

namespace oriel::detail {
namespace {

using SpatialPose = PoseGraphFile::SpatialPose;

enum class Kind {
  vertex2,
  vertex3,
  vertex3_euler,
  point2,
  point3,
  edge2,
  edge3,
  edge3_euler,
  sighting2,
  bearing2,
  sighting3,
  sighting3_bare,
  offset,
  fix
};

enum : unsigned { kG2o = 1, kToro = 2, kIsam = 4, kAny = 7 };

struct Tag {
  std::string_view name;
  Kind kind;
  unsigned spellings;  // in which it stands
  int dimension;       // 0: either
};

constexpr Tag kTags[] = {
    {"VERTEX_SE2", Kind::vertex2, kG2o, 2},
    {"VERTEX_XY", Kind::point2, kG2o, 2},
    {"EDGE_SE2", Kind::edge2, kG2o, 2},
    {"EDGE_SE2_XY", Kind::sighting2, kG2o, 2},
    {"EDGE_BEARING_SE2_XY", Kind::bearing2, kG2o, 2},
    {"VERTEX_SE3:QUAT", Kind::vertex3, kG2o, 3},
    {"VERTEX_TRACKXYZ", Kind::point3, kG2o, 3},
    {"EDGE_SE3:QUAT", Kind::edge3, kG2o, 3},
    {"EDGE_SE3_TRACKXYZ", Kind::sighting3, kG2o, 3},
    {"PARAMS_SE3OFFSET", Kind::offset, kG2o, 3},
    {"FIX", Kind::fix, kAny, 0},
    {"VERTEX2", Kind::vertex2, kToro, 2},
    {"VERTEX", Kind::vertex2, kToro, 2},
    {"VERTEX3", Kind::vertex3_euler, kToro, 3},
    {"EDGE", Kind::edge2, kToro, 2},
    {"EDGE2", Kind::edge2, kToro | kIsam, 2},
    {"EDGE3", Kind::edge3_euler, kToro | kIsam, 3},
    {"ODOMETRY", Kind::edge2, kIsam, 2},
    {"LANDMARK", Kind::sighting2, kIsam, 2},
    {"POINT3", Kind::sighting3_bare, kIsam, 3},
};

constexpr const char* kPlanarFields[] = {"x", "y", "theta", "I11", "I12", "I13", "I22", "I23", "I33"};
constexpr const char* kPlanarPointFields[] = {"x", "y", "I11", "I12", "I22"};
constexpr const char* kBearingFields[] = {"the bearing", "I11"};
constexpr const char* kSpatialPointFields[] = {"x", "y", "z", "I11", "I12", "I13", "I22", "I23", "I33"};
constexpr const char* kSpatialFields[] = {"x",   "y",   "z",   "qx",  "qy",  "qz",  "qw",  "I11", "I12", "I13",
                                          "I14", "I15", "I16", "I22", "I23", "I24", "I25", "I26", "I33", "I34",
                                          "I35", "I36", "I44", "I45", "I46", "I55", "I56", "I66"};
constexpr const char* kEulerFields[] = {"x",   "y",   "z",   "roll", "pitch", "yaw", "I11", "I12", "I13",
                                        "I14", "I15", "I16", "I22",  "I23",   "I24", "I25", "I26", "I33",
                                        "I34", "I35", "I36", "I44",  "I45",   "I46", "I55", "I56", "I66"};

const char* name_of(unsigned spellings) {
  if (spellings == kG2o) return "g2o";
  return spellings == kToro ? "TORO" : spellings == kIsam ? "iSAM" : "TORO or iSAM";
}

bool normalise(double* q) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(norm > 1e-9) || !std::isfinite(norm)) return false;
  for (int i = 0; i < 4; ++i) q[i] /= norm;
  return true;
}

// R = Rz(yaw) Ry(pitch) Rx(roll). Whole turns are taken off first: the square of an angle must not overflow.
SpatialPose from_euler(const double* v) {
  constexpr double kTurn = 6.283185307179586;
  const double roll = std::remainder(v[3], kTurn), pitch = std::remainder(v[4], kTurn);
  const double yaw = std::remainder(v[5], kTurn);
  const Rot3d R = Rot3d::exp({{0, 0, yaw}}) * Rot3d::exp({{0, pitch, 0}}) * Rot3d::exp({{roll, 0, 0}});
  const Rot3d q = R.normalized();
  return {{v[0], v[1], v[2]}, q.qx, q.qy, q.qz, q.qw};
}

class Reader {
 public:
  Reader(std::string_view text, std::string file_name) : scanner_(text) {
    lines_.graph.file_name = std::move(file_name);
  }

  Result<PoseGraphLines> read() {
    while (scanner_.next_line())
      if (!read_line()) return error_;
    PoseGraphFile& g = lines_.graph;
    if (spellings_ == (kToro | kIsam))
      g.spelling = guess_spelling(g);
    else if (spellings_ != kAny && (spellings_ & kG2o) == 0)
      g.spelling = spellings_ == kToro ? PoseGraphSpelling::toro : PoseGraphSpelling::isam;
    return std::move(lines_);
  }

 private:
  bool read_line() {
    const std::string_view word = scanner_.token();
    if (word != tag_->name && !find_tag(word)) return false;
    return dispatch() && end_of_line();
  }

  // Most lines repeat the tag of the line before, for which nothing of this is done.
  bool find_tag(std::string_view word) {
    const Tag* found = std::find_if(std::begin(kTags), std::end(kTags), [&](const Tag& t) { return t.name == word; });
    if (found == std::end(kTags)) return unknown_tag(word);
    tag_ = found;
    if ((spellings_ & found->spellings) == 0)
      return fail(ErrorCode::bad_input, std::string("expected a tag of ") + name_of(spellings_) +
                                            " as in the lines before, found " + std::string(word));
    spellings_ &= found->spellings;
    return found->dimension == 0 || claim_dimension(found->dimension == 3);
  }

  bool unknown_tag(std::string_view word) {
    return fail(ErrorCode::bad_input,
                "expected a tag of g2o (VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT, FIX, ...), TORO or iSAM, "
                "found " +
                    quote_token(word));
  }

  bool dispatch() {
    PoseGraphFile& g = lines_.graph;
    switch (tag_->kind) {
      case Kind::vertex2:
        return vertex2();
      case Kind::vertex3:
        return vertex3();
      case Kind::vertex3_euler:
        return vertex3_euler();
      case Kind::point2:
        return point2();
      case Kind::point3:
        return point3();
      case Kind::edge2:
        return edge2();
      case Kind::edge3:
        return edge3();
      case Kind::edge3_euler:
        return edge3_euler();
      case Kind::sighting2:
        return sighting<2>(g.planar_sightings, lines_.sightings, kPlanarPointFields, [](auto& s, const double* v) {
          s.measurement = {v[0], v[1]};
        });
      case Kind::bearing2:
        return sighting<1>(g.planar_bearings, lines_.bearings, kBearingFields,
                           [](auto& s, const double* v) { s.measurement = v[0]; });
      case Kind::sighting3:
        return sighting3(true);
      case Kind::sighting3_bare:
        return sighting3(false);
      case Kind::offset:
        return offset();
      case Kind::fix:
        return fix();
    }
    return false;
  }

  bool vertex2() {
    double v[3];
    if (!declare(lines_.graph.ids, lines_.graph.pose_lines) || !read_numbers(kPlanarFields, v, 3)) return false;
    lines_.graph.planar_poses.push_back({v[0], v[1], v[2]});
    return true;
  }

  bool vertex3() {
    SpatialPose pose;
    if (!declare(lines_.graph.ids, lines_.graph.pose_lines) || !read_pose(pose)) return false;
    lines_.graph.spatial_poses.push_back(pose);
    return true;
  }

  bool vertex3_euler() {
    double v[6];
    if (!declare(lines_.graph.ids, lines_.graph.pose_lines) || !read_numbers(kEulerFields, v, 6)) return false;
    lines_.graph.spatial_poses.push_back(from_euler(v));
    return true;
  }

  bool point2() {
    double v[2];
    if (!declare(lines_.graph.landmark_ids, lines_.graph.landmark_lines) || !read_numbers(kPlanarFields, v, 2))
      return false;
    lines_.graph.planar_landmarks.push_back({v[0], v[1]});
    return true;
  }

  bool point3() {
    double v[3];
    if (!declare(lines_.graph.landmark_ids, lines_.graph.landmark_lines) || !read_numbers(kSpatialFields, v, 3))
      return false;
    lines_.graph.spatial_landmarks.push_back({v[0], v[1], v[2]});
    return true;
  }

  bool offset() {
    PoseGraphFile::SensorOffset o;
    if (!read_id("id", o.id) || !read_pose(o.T_body_sensor)) return false;
    o.line = scanner_.line();
    lines_.graph.offsets.push_back(o);
    return true;
  }

  bool edge2() {
    double v[9];
    if (!read_ends(lines_.edges, "from", "to") || !read_numbers(kPlanarFields, v, 9)) return false;
    auto& e = append(lines_.graph.planar_edges);
    e.measurement = {v[0], v[1], v[2]};
    std::copy_n(v + 3, 6, e.information.begin());
    return true;
  }

  bool edge3() {
    double v[28];
    if (!read_ends(lines_.edges, "from", "to") || !read_numbers(kSpatialFields, v, 28)) return false;
    if (!normalise(v + 3)) return bad_quaternion();
    auto& e = append(lines_.graph.spatial_edges);
    e.measurement = {{v[0], v[1], v[2]}, v[3], v[4], v[5], v[6]};
    std::copy_n(v + 7, 21, e.information.begin());
    return true;
  }

  bool edge3_euler() {
    double v[27];
    if (!read_ends(lines_.edges, "from", "to") || !read_numbers(kEulerFields, v, 27)) return false;
    auto& e = append(lines_.graph.spatial_edges);
    e.measurement = from_euler(v);
    std::copy_n(v + 6, 21, e.information.begin());
    return true;
  }

  bool sighting3(bool has_offset) {
    constexpr std::int64_t kNoOffset = -1;
    auto& ends = lines_.sightings;
    std::int64_t offset_id = kNoOffset;
    double v[9];
    if (!read_ends(ends, "the pose", "the landmark") || (has_offset && !read_id("the offset", offset_id))) return false;
    if (!read_numbers(kSpatialPointFields, v, 9)) return false;
    auto& s = append(lines_.graph.spatial_sightings);
    s.measurement = {v[0], v[1], v[2]};
    std::copy_n(v + 3, 6, s.information.begin());
    lines_.offset_ids.push_back(offset_id);
    return true;
  }

  template <int Values, class Sighting, class Store>
  bool sighting(std::vector<Sighting>& list, std::vector<PoseGraphLines::Ends>& ends, const char* const* fields,
                Store&& store) {
    constexpr int kCount = Values + Values * (Values + 1) / 2;
    double v[kCount];
    if (!read_ends(ends, "the pose", "the landmark") || !read_numbers(fields, v, kCount)) return false;
    auto& s = append(list);
    store(s, v);
    std::copy_n(v + Values, kCount - Values, s.information.begin());
    return true;
  }

  bool fix() {
    do {
      std::int64_t id;
      if (!read_id("id", id)) return false;
      lines_.fixes.push_back({id, scanner_.line()});
    } while (!scanner_.at_end_of_line());
    return true;
  }

  // Sized once, by what the rest of the file may well hold: pages that are never written cost nothing.
  template <class T>
  T& append(std::vector<T>& list) {
    constexpr std::size_t kLine = std::max<std::size_t>(40, sizeof(T) * 3 / 4);
    if (list.capacity() == 0) list.reserve(1 + scanner_.bytes_left() / kLine);
    T& item = list.emplace_back();
    if constexpr (requires { item.line; }) item.line = scanner_.line();
    return item;
  }

  bool declare(std::vector<std::int64_t>& ids, std::vector<std::int64_t>& id_lines) {
    std::int64_t id;
    if (!read_id("id", id)) return false;
    append(ids) = id;
    append(id_lines) = scanner_.line();
    return true;
  }

  bool read_ends(std::vector<PoseGraphLines::Ends>& list, const char* first, const char* second) {
    PoseGraphLines::Ends ends;
    if (!read_id(first, ends.first) || !read_id(second, ends.second)) return false;
    append(list) = ends;
    return true;
  }

  bool read_pose(SpatialPose& pose) {
    double v[7];
    if (!read_numbers(kSpatialFields, v, 7)) return false;
    if (!normalise(v + 3)) return bad_quaternion();
    pose = {{v[0], v[1], v[2]}, v[3], v[4], v[5], v[6]};
    return true;
  }

  bool claim_dimension(bool is_3d) {
    if (dimension_known_ && lines_.graph.is_3d != is_3d)
      return fail(ErrorCode::bad_input, std::string("expected ") + (is_3d ? "SE2" : "SE3") +
                                            " as in the lines before, found " + std::string(tag_->name));
    dimension_known_ = true;
    lines_.graph.is_3d = is_3d;
    return true;
  }

  bool read_id(const char* field, std::int64_t& id) {
    constexpr std::int64_t kMost = std::int64_t{1} << 61;  // so that sums of two ids are ids
    const NumberFault fault = scanner_.integer(id);
    if (fault == NumberFault::none && id >= 0 && id <= kMost) [[likely]]
      return true;
    if (fault == NumberFault::none && id > kMost)
      return fail_tag(ErrorCode::bad_input, std::string("expected an id for ") + field + ", found " +
                                                std::to_string(id) + ", which is out of range");
    if (fault == NumberFault::none)
      return fail_tag(ErrorCode::bad_input,
                      std::string("expected an id of 0 or more for ") + field + ", found " + std::to_string(id));
    return fail_tag(ErrorCode::bad_input, describe_number(fault, "an id", field, scanner_.token()));
  }

  bool read_numbers(const char* const* fields, double* out, int count) {
    NumberFault fault;
    const int got = scanner_.numbers(out, count, fault);
    if (got == count) [[likely]]
      return true;
    const ErrorCode code = fault == NumberFault::not_finite ? ErrorCode::not_finite : ErrorCode::bad_input;
    return fail_tag(code, describe_number(fault, "a finite number", fields[got], scanner_.token()));
  }

  bool end_of_line() {
    if (scanner_.at_end_of_line()) return true;
    return fail_tag(ErrorCode::bad_input, "expected the end of the line, found " + quote_token(scanner_.token()));
  }

  bool bad_quaternion() { return fail_tag(ErrorCode::bad_input, "expected a quaternion that is not zero"); }

  bool fail_tag(ErrorCode code, const std::string& message) {
    return fail(code, std::string(tag_->name) + ": " + message);
  }
  bool fail(ErrorCode code, std::string message) {
    error_ = {code, std::move(message), lines_.graph.file_name, scanner_.line()};
    return false;
  }

  static constexpr Tag kNone{"", Kind::fix, kAny, 0};
  TextScanner scanner_;
  PoseGraphLines lines_;
  const Tag* tag_ = &kNone;
  unsigned spellings_ = kAny;
  bool dimension_known_ = false;
  Error error_;
};

}  // namespace

Result<PoseGraphLines> read_pose_graph_lines(std::string_view text, std::string file_name) {
  return Reader(text, std::move(file_name)).read();
}

}  // namespace oriel::detail
