#include "oriel/io/visual_map_file.h"

#include <algorithm>
#include <array>
#include <utility>

#include "oriel/io/text.h"

namespace oriel {
namespace {

// ---- writing ----

class Writer {
 public:
  std::string text;

  void number(double x) {
    append_number(text, x);
    text += ' ';
  }
  void integer(std::int64_t n) {
    append_number(text, n);
    text += ' ';
  }
  void row(std::uint32_t r) {
    if (r == kNoRow)
      text += "- ";
    else
      integer(r);
  }
  template <int N>
  void vector(const Vec<double, N>& v) {
    for (int i = 0; i < N; ++i) number(v[i]);
  }
  template <int N>
  void triangle(const Mat<double, N, N>& a) {
    for (int i = 0; i < N; ++i)
      for (int j = i; j < N; ++j) number(a(i, j));
  }
  void end_line() { text.back() = '\n'; }
  void group(const char* name, std::size_t count) {
    text += name;
    text += ' ';
    integer(static_cast<std::int64_t>(count));
    end_line();
  }
};

void write_rigs(Writer& out, const VisualMap& map) {
  out.group("rigs", map.rigs.size());
  for (const StereoRigd& rig : map.rigs)
    for (const auto& c : rig.cameras) {
      const auto& k = c.camera;
      for (const double x : {k.fx, k.fy, k.cx, k.cy, k.k1, k.k2, k.p1, k.p2}) out.number(x);
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) out.number(c.R_body_camera(i, j));
      out.vector(c.t_body_camera);
      out.end_line();
    }
}

void write_frames(Writer& out, const MapFrames& f) {
  out.group("frames", f.size());
  for (std::uint32_t k = 0; k < f.size(); ++k) {
    const Pose3d& T = f.T_world_body[k];
    out.integer(f.time[k].ns);
    out.vector(T.t);
    for (const double q : {T.R.qx, T.R.qy, T.R.qz, T.R.qw}) out.number(q);
    out.text += std::string(name_of(f.status[k])) + ' ';
    out.row(f.previous[k]);
    out.integer(f.rig[k]);
    out.integer(f.count[k]);
    out.triangle(f.covariance[k]);
    out.end_line();
  }
}

void write_points(Writer& out, const MapPoints& p) {
  out.group("points", p.size());
  for (std::uint32_t k = 0; k < p.size(); ++k) {
    out.integer(p.track[k]);
    out.vector(p.p[k]);
    out.row(p.frame[k]);
    out.integer(p.sightings[k]);
    out.triangle(p.covariance[k]);
    out.end_line();
  }
}

void write_observations(Writer& out, const MapObservations& o) {
  out.group("observations", o.size());
  for (std::uint32_t k = 0; k < o.size(); ++k) {
    out.row(o.point[k]);
    out.integer(o.track[k]);
    out.integer(o.has_right[k]);
    out.integer(o.inlier[k]);
    out.vector(o.pixel0[k]);
    out.vector(o.pixel1[k]);
    out.triangle(o.covariance0[k]);
    out.triangle(o.covariance1[k]);
    out.vector(o.p_camera[k]);
    out.triangle(o.covariance[k]);
    out.end_line();
  }
}

// ---- reading ----

// Getters return at once after the first fault; error() says what it was.
class Reader {
 public:
  Reader(std::string_view text, const std::string& file_name) : scanner_(text), file_name_(file_name) {}

  bool ok() const { return ok_; }
  const Error& error() const { return error_; }
  std::int64_t at() const { return scanner_.line(); }
  void fail(const std::string& message) {
    if (ok_) error_ = {ErrorCode::bad_input, message, file_name_, std::max<std::int64_t>(1, scanner_.line())};
    ok_ = false;
  }

  void line(const char* expected) {
    if (ok_ && !scanner_.next_line()) fail(std::string("expected ") + expected + ", found the end of the file");
  }
  void end_of_line() {
    if (ok_ && !scanner_.at_end_of_line()) fail("expected the end of the line, found " + quote_token(scanner_.token()));
  }
  std::string_view word() { return ok_ ? scanner_.token() : std::string_view(); }
  double number(const char* what) {
    double x = 0.0;
    if (!ok_) return x;
    const NumberFault fault = scanner_.number(x);
    if (fault != NumberFault::none) fail(describe_number(fault, "a finite number", what, word()));
    return x;
  }
  std::int64_t integer(const char* what, std::int64_t least, std::int64_t most) {
    std::int64_t n = least;
    if (!ok_) return n;
    const NumberFault fault = scanner_.integer(n);
    if (fault != NumberFault::none)
      fail(describe_number(fault, "a whole number", what, word()));
    else if (n < least || n > most)
      fail("expected " + std::to_string(least) + " to " + std::to_string(most) + " for " + what + ", found " +
           std::to_string(n));
    return n;
  }
  std::uint32_t count(const char* what, std::int64_t most) {
    return static_cast<std::uint32_t>(integer(what, 0, most));
  }
  // A row of a group with so many, or none.
  std::uint32_t row(const char* what, std::uint32_t rows) {
    const std::string_view token = word();
    if (!ok_ || token == "-") return kNoRow;
    std::int64_t n = 0;
    const NumberFault fault = parse_integer(token, n);
    if (fault == NumberFault::none && n >= 0 && n < rows) return static_cast<std::uint32_t>(n);
    fail(std::string("expected - or a row below ") + std::to_string(rows) + " for " + what + ", found " +
         quote_token(token));
    return kNoRow;
  }
  template <int N>
  Vec<double, N> vector(const char* what) {
    Vec<double, N> v;
    for (int i = 0; i < N; ++i) v[i] = number(what);
    return v;
  }
  template <int N>
  Mat<double, N, N> triangle(const char* what) {
    Mat<double, N, N> a;
    for (int i = 0; i < N; ++i)
      for (int j = i; j < N; ++j) a(i, j) = a(j, i) = number(what);
    return a;
  }
  // "name N", N lines of at least so many bytes each: no count asks for memory that the file does not justify.
  std::uint32_t group(const char* name, std::size_t least_bytes) {
    line(name);
    const std::string_view found = word();
    if (ok_ && found != name) fail(std::string("expected ") + name + ", found " + quote_token(found));
    const std::uint32_t n = count(name, kNoRow - 1);
    end_of_line();
    if (ok_ && n > scanner_.bytes_left() / least_bytes)
      fail(std::string("expected ") + name + " as many as there are lines, found " + std::to_string(n));
    return ok_ ? n : 0;
  }

 private:
  TextScanner scanner_;
  const std::string& file_name_;
  bool ok_ = true;
  Error error_;
};

// Where each row of a group stands, for faults that show in the whole.
using Lines = std::array<std::vector<std::int64_t>, 4>;

void read_rigs(Reader& in, VisualMap& map, Lines& lines) {
  const std::uint32_t n = in.group("rigs", 80);
  for (std::uint32_t k = 0; k < n && in.ok(); ++k) {
    StereoRigd& rig = map.rigs.emplace_back();
    lines[static_cast<std::size_t>(MapGroup::rig)].push_back(in.at() + 1);
    for (auto& c : rig.cameras) {
      in.line("a camera");
      auto& m = c.camera;
      for (double* x : {&m.fx, &m.fy, &m.cx, &m.cy, &m.k1, &m.k2, &m.p1, &m.p2}) *x = in.number("the camera");
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) c.R_body_camera(i, j) = in.number("R_body_camera");
      c.t_body_camera = in.vector<3>("t_body_camera");
      in.end_of_line();
    }
  }
}

FrameStatus read_status(Reader& in) {
  const std::string_view word = in.word();
  std::string known;
  for (int k = 0; k < kFrameStatuses; ++k) {
    const auto status = static_cast<FrameStatus>(k);
    if (word == name_of(status)) return status;
    known += (known.empty() ? "" : ", ") + std::string(name_of(status));
  }
  in.fail("expected one of " + known + " for the status, found " + quote_token(word));
  return FrameStatus::pending;
}

void read_frames(Reader& in, VisualMap& map, std::vector<std::uint32_t>& counts, Lines& lines) {
  const std::uint32_t n = in.group("frames", 60);
  for (std::uint32_t k = 0; k < n && in.ok(); ++k) {
    in.line("a frame");
    lines[static_cast<std::size_t>(MapGroup::frame)].push_back(in.at());
    const Time time{in.integer("the stamp", INT64_MIN, INT64_MAX)};
    Pose3d T;
    T.t = in.vector<3>("the position");
    for (double* q : {&T.R.qx, &T.R.qy, &T.R.qz, &T.R.qw}) *q = in.number("the quaternion");
    map.add_frame(time, T, 0);
    map.frames.status.back() = read_status(in);
    map.frames.previous.back() = in.row("the previous frame", k);
    map.frames.rig.back() = in.count("the rig", static_cast<std::int64_t>(map.rigs.size()) - 1);
    counts.push_back(in.count("the observations", kNoRow - 1));
    map.frames.covariance.back() = in.triangle<6>("the covariance");
    in.end_of_line();
  }
}

void read_points(Reader& in, VisualMap& map, Lines& lines) {
  const std::uint32_t n = in.group("points", 20);
  for (std::uint32_t k = 0; k < n && in.ok(); ++k) {
    in.line("a point");
    lines[static_cast<std::size_t>(MapGroup::point)].push_back(in.at());
    const std::int64_t track = in.integer("the track", INT64_MIN, INT64_MAX);
    const Vec3d p = in.vector<3>("the position");
    const std::uint32_t frame = in.row("the frame", map.frames.size());
    const std::uint32_t sightings = in.count("the sightings", kNoRow);
    map.add_point(track, p, in.triangle<3>("the covariance"), frame);
    map.points.sightings.back() = sightings;
    in.end_of_line();
  }
}

void read_observation(Reader& in, VisualMap& map) {
  in.line("an observation");
  const std::uint32_t point = in.row("the point", map.points.size());
  VisualMap::Observation o;
  o.track = in.integer("the track", INT64_MIN, INT64_MAX);
  o.has_right = in.integer("whether the right camera saw it", 0, 1) == 1;
  const std::int64_t inlier = in.integer("whether it is an inlier", 0, 1);
  o.pixel0 = in.vector<2>("the left pixel");
  o.pixel1 = in.vector<2>("the right pixel");
  o.covariance0 = in.triangle<2>("the left covariance");
  o.covariance1 = in.triangle<2>("the right covariance");
  o.p_camera = in.vector<3>("the point");
  o.covariance = in.triangle<3>("the covariance");
  in.end_of_line();
  if (!in.ok()) return;
  map.add_observation(o);
  map.observations.point.back() = point;
  map.observations.inlier.back() = static_cast<std::uint8_t>(inlier);
}

// Frame by frame, as many as each of them says.
void read_observations(Reader& in, VisualMap& map, const std::vector<std::uint32_t>& counts, Lines& lines) {
  const std::uint32_t n = in.group("observations", 20);
  std::uint64_t announced = 0;
  for (const std::uint32_t c : counts) announced += c;
  if (in.ok() && announced != n)
    in.fail("expected " + std::to_string(announced) + " observations, as the frames say, found " + std::to_string(n));
  for (std::uint32_t f = 0; f < counts.size() && in.ok(); ++f) {
    map.frames.first[f] = map.observations.size();
    for (std::uint32_t k = 0; k < counts[f] && in.ok(); ++k) {
      read_observation(in, map);
      if (in.ok()) map.observations.frame.back() = f;
      lines[static_cast<std::size_t>(MapGroup::observation)].push_back(in.at());
    }
  }
  map.frames.count = counts;  // add_observation counted them all as the newest frame's
}

}  // namespace

std::string format_visual_map(const VisualMap& map) {
  Writer out;
  out.text = std::string(kVisualMapFormat) + '\n';
  write_rigs(out, map);
  write_frames(out, map.frames);
  write_points(out, map.points);
  write_observations(out, map.observations);
  out.text += "end\n";
  return std::move(out.text);
}

Result<VisualMap> parse_visual_map(std::string_view text, const std::string& file_name) {
  Reader in(text, file_name);
  VisualMap map;
  std::vector<std::uint32_t> counts;
  in.line("a visual map");
  if (const std::string_view format = in.word(); in.ok() && format != kVisualMapFormat)
    in.fail("expected " + std::string(kVisualMapFormat) + ", found " + quote_token(format));
  in.end_of_line();
  Lines lines;
  read_rigs(in, map, lines);
  read_frames(in, map, counts, lines);
  read_points(in, map, lines);
  read_observations(in, map, counts, lines);
  in.line("end");
  if (const std::string_view end = in.word(); in.ok() && end != "end")
    in.fail("expected end, found " + quote_token(end));
  if (!in.ok()) return in.error();
  MapFault fault;
  if (auto ok = map.check(&fault); !ok) {
    Error error = ok.error();
    error.file = file_name;
    const auto& at = lines[static_cast<std::size_t>(fault.group)];
    error.line = fault.row < at.size() ? at[fault.row] : 0;
    return error;
  }
  return map;
}

Result<VisualMap> read_visual_map(const std::string& path) {
  const Result<std::string> text = read_text_file(path);
  if (!text) return text.error();
  return parse_visual_map(*text, path);
}

Result<void> write_visual_map(const std::string& path, const VisualMap& map) {
  if (auto ok = map.check(); !ok) return ok;
  return write_text_file(path, format_visual_map(map));
}

}  // namespace oriel
