// The three ways in which a job runs (executor.h).
#pragma once
#include "oriel/run/executor.h"

namespace oriel::run_detail {

// What a task does, with a lack of memory as an error: of a context, and of one job, where it is also said apart.
Result<void*> make_context(const TaskOps& task, std::span<const std::byte> config);
Result<void> run_job(const TaskOps& task, void* context, std::span<const std::byte> input, Bytes& output,
                     bool& out_of_memory);

JobRunner* make_in_place_runner(const TaskOps& task, Bytes config);
JobRunner* make_thread_runner(const TaskOps& task, Bytes config, const ExecutorOptions& options);
JobRunner* make_process_runner(const TaskOps& task, Bytes config, const ExecutorOptions& options);

}  // namespace oriel::run_detail
