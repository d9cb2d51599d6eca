// The tables of a recording: IMU samples, feature tracks, ground truth.
#include <unordered_map>
#include <utility>

#include "oriel/io/recording.h"
#include "oriel/io/text.h"

namespace oriel {
namespace {

constexpr const char* kImuFields[] = {"timestamp_ns", "wx", "wy", "wz", "ax", "ay", "az"};
constexpr const char* kTrackFields[] = {"timestamp_ns", "frame", "track_id", "u0", "v0", "u1", "v1"};
constexpr int kColumns = 7;

// Reads rows of seven columns, and keeps what a message needs: file, line, sensor.
class TableReader {
 public:
  TableReader(std::string_view text, const std::string& file_name, std::string sensor)
      : scanner_(text), file_name_(file_name), sensor_(std::move(sensor)) {}

  // False at the end and on an error; ok() tells which.
  bool next_row(const char* columns) {
    std::string_view row;
    if (!scanner_.next_row(row)) return false;
    ++row_;
    const int count = split_fields(row, fields_, kColumns);
    if (count == kColumns) return true;
    return fail("expected 7 columns " + std::string(columns) + ", found " + std::to_string(count));
  }

  bool integer(int column, const char* name, std::int64_t& out) {
    const NumberFault fault = parse_integer(fields_[column], out);
    return fault == NumberFault::none || fail(describe_number(fault, "an integer", name, fields_[column]));
  }
  bool number(int column, const char* name, double& out) {
    const NumberFault fault = parse_number(fields_[column], out);
    return fault == NumberFault::none ||
           fail(describe_number(fault, "a finite number", name, fields_[column]),
                fault == NumberFault::not_finite ? ErrorCode::not_finite : ErrorCode::bad_input);
  }
  bool empty(int column) const { return fields_[column].empty(); }

  bool fail(const std::string& message, ErrorCode code = ErrorCode::bad_input) {
    error_ = {code, sensor_ + " " + std::to_string(row_ - 1) + ": " + message, file_name_, scanner_.line()};
    failed_ = true;
    return false;
  }
  bool ok() const { return !failed_; }
  const Error& error() const { return error_; }

 private:
  TableScanner scanner_;
  const std::string& file_name_;
  std::string sensor_;  // "IMU sample", "track row": with the row's number from 0 it names the item
  std::int64_t row_ = 0;
  std::string_view fields_[kColumns];
  bool failed_ = false;
  Error error_;
};

bool read_observation(TableReader& table, std::size_t cameras, RecordedObservation& o) {
  if (!table.integer(2, kTrackFields[2], o.track_id)) return false;
  if (!table.number(3, "u0", o.u0) || !table.number(4, "v0", o.v0)) return false;
  o.has_right = !(table.empty(5) && table.empty(6));
  o.u1 = o.v1 = 0;
  if (!o.has_right) return true;
  if (!table.number(5, "u1", o.u1) || !table.number(6, "v1", o.v1)) return false;
  return cameras > 1 || table.fail("expected no u1,v1, as the calibration has one camera");
}

bool start_frame(TableReader& table, RecordedTracks& tracks, Time time, std::int64_t number) {
  if (!tracks.frames.empty()) {
    const RecordedFrame& last = tracks.frames.back();
    if ((number == last.number) != (time == last.time))
      return table.fail("expected one stamp for each frame number, found " + std::to_string(time.ns) + " for frame " +
                        std::to_string(number) + " after " + std::to_string(last.time.ns) + " for frame " +
                        std::to_string(last.number));
    if (number == last.number) return true;
    if (time < last.time || number < last.number)
      return table.fail("expected frames in rising order, found frame " + std::to_string(number) + " at " +
                        std::to_string(time.ns) + " ns after frame " + std::to_string(last.number) + " at " +
                        std::to_string(last.time.ns) + " ns");
  }
  tracks.frames.push_back({time, number, tracks.observations.size(), 0});
  return true;
}

}  // namespace

Result<std::vector<RecordedImu>> parse_imu_csv(std::string_view text, const std::string& file_name) {
  TableReader table(text, file_name, "IMU sample");
  std::vector<RecordedImu> samples;
  while (table.next_row("timestamp_ns,wx,wy,wz,ax,ay,az")) {
    RecordedImu s;
    bool ok = table.integer(0, kImuFields[0], s.time.ns);
    for (int i = 0; i < 3 && ok; ++i) ok = table.number(1 + i, kImuFields[1 + i], s.gyro[i]);
    for (int i = 0; i < 3 && ok; ++i) ok = table.number(4 + i, kImuFields[4 + i], s.accel[i]);
    if (!ok) return table.error();
    if (!samples.empty() && s.time <= samples.back().time) {
      table.fail(std::string("expected a later stamp than ") + std::to_string(samples.back().time.ns) + ", found " +
                 std::to_string(s.time.ns) + (s.time == samples.back().time ? " (duplicate)" : " (backward)"));
      return table.error();
    }
    samples.push_back(s);
  }
  if (!table.ok()) return table.error();
  if (samples.empty()) return Error{ErrorCode::bad_input, "IMU: expected samples, found none", file_name};
  return samples;
}

Result<RecordedTracks> parse_tracks_csv(std::string_view text, const std::string& file_name, std::size_t cameras) {
  TableReader table(text, file_name, "track row");
  RecordedTracks tracks;
  std::unordered_map<std::int64_t, std::int64_t> last_seen;  // track → number of the frame
  while (table.next_row("timestamp_ns,frame,track_id,u0,v0,u1,v1")) {
    Time time;
    std::int64_t number;
    RecordedObservation o;
    if (!table.integer(0, kTrackFields[0], time.ns) || !table.integer(1, kTrackFields[1], number) ||
        !read_observation(table, cameras, o) || !start_frame(table, tracks, time, number))
      return table.error();
    const auto [seen, is_new] = last_seen.try_emplace(o.track_id, number);
    if (!is_new && seen->second == number) {
      table.fail("expected each track once a frame, found track " + std::to_string(o.track_id) + " again in frame " +
                     std::to_string(number),
                 ErrorCode::duplicate);
      return table.error();
    }
    seen->second = number;
    tracks.observations.push_back(o);
    ++tracks.frames.back().count;
  }
  if (!table.ok()) return table.error();
  if (tracks.frames.empty()) return Error{ErrorCode::bad_input, "camera: expected track rows, found none", file_name};
  return tracks;
}

Result<std::vector<TumPose>> parse_groundtruth(std::string_view text, const std::string& file_name) {
  Result<TrajectoryFile> file = parse_trajectory(text, file_name, StampOrder::rising);
  if (!file) {
    Error error = file.error();
    error.message = "ground truth: " + error.message;
    return error;
  }
  if (!file->stamped) return Error{ErrorCode::bad_input, "ground truth: expected `t x y z qx qy qz qw`", file_name, 1};
  return std::move(file->poses);
}

}  // namespace oriel
