// The three ways in which a job runs (executor.h).
#pragma once
#include "oriel/run/executor.h"

namespace oriel::run_detail {

JobRunner* make_in_place_runner(const TaskOps& task, Bytes config);
JobRunner* make_thread_runner(const TaskOps& task, Bytes config, const ExecutorOptions& options);
JobRunner* make_process_runner(const TaskOps& task, Bytes config, const ExecutorOptions& options);

}  // namespace oriel::run_detail
