// What an executor says of a job.
#pragma once
#include <cstdint>
#include <iosfwd>
#include <string>

namespace oriel {

using JobId = std::uint64_t;  // from 1, rising

enum class JobStatus {
  none,        // there is no job
  accepted,    // it runs, or has run; write_back tells
  waiting,     // another is in flight; it begins when the result of that one is taken
  busy,        // refused: another job is in flight, and waits to be written back
  done,        // its result is there
  failed,      // the task's own error, or no memory left for it; the message is its text
  died,        // the worker's process ended before it answered
  timed_out,   // not done within the time limit; its process was ended
  terminated,  // refused: the executor was terminated
};

struct JobReport {
  JobId job = 0;
  JobStatus status = JobStatus::none;
  std::string message = {};   // one line where something went wrong
  bool restarted = false;     // the worker was started anew before or for this job
  bool context_anew = false;  // and its context could not travel: it was made by init_context again
  bool worker_lost = false;   // its process has gone or was given up: the next job starts another

  bool ok() const {
    return status == JobStatus::none || status == JobStatus::accepted || status == JobStatus::waiting ||
           status == JobStatus::done;
  }
  explicit operator bool() const { return ok(); }
};

const char* name_of(JobStatus status);
std::ostream& operator<<(std::ostream& out, const JobReport& report);

}  // namespace oriel
