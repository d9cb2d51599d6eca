// A recording through a sliding window that a config put together (task sliding_window), and how good that was.
#pragma once
#include "apps/run_recording.h"
#include "oriel/io/run_config.h"

namespace oriel::apps {

// Of `config`: task sliding_window. A process needs the zygote (config.executor). `progress`: a line on standard error.
// Errors: parts that need what the recording has not, an engine that this program has not.
Result<RunReport> run_window(const Recording& recording, const RunConfig& config, const RunNames& names,
                             const ExecutorOptions& worker, bool progress);

}  // namespace oriel::apps
