// A task: work that can run where its caller is, in a thread, or in a child process, with the same bits (R1).
//
//     struct Doubling {
//       struct Map { std::vector<double> values; };                       // the caller's world
//       struct Config { double factor = 2.0; };                           // any of these four: Transferable
//       struct Context { double factor; int jobs = 0; };                  // any type; lives where the work runs
//       struct Input { std::vector<double> values; };
//       struct Output { std::vector<double> values; };
//       static Context init_context(const Config& c) { return {c.factor}; }
//       Input collect(const Map& map) const { return {map.values}; }      // more arguments as the task likes
//       static Output optimize(Context&, const Input&);                   // may throw, or return Result<Output>
//       static void write(const Output& out, Map& map) { map.values = out.values; }
//     };
//
// All but collect are static: they run anywhere, with nothing but what they are given. init_context may return a
// Result as well. A task may have `static constexpr const char* kName`, by which `ps` and configs call it, and
// `static Input merge(const Input& waiting, const Input& newer)`, for callers that submit faster than it works.
//
// The context is made once and changes with each job. Where it is copyable a job that fails leaves it as it was
// before; where it is Transferable the last good one travels with each result, and a worker that has to be started
// anew begins with it.
#pragma once
#include <concepts>
#include <exception>
#include <memory>
#include <new>
#include <optional>

#include "oriel/run/transfer.h"

namespace oriel {

namespace task_detail {

template <class F>
struct Signature;
template <class R, class... A>
struct Signature<R (*)(A...)> {
  using Return = R;
  template <std::size_t I>
  using Argument = std::remove_cvref_t<std::tuple_element_t<I, std::tuple<A...>>>;
  static constexpr std::size_t kArguments = sizeof...(A);
};
template <class T>
struct Unwrapped {
  using type = T;
};
template <class T>
struct Unwrapped<Result<T>> {
  using type = T;
};

template <class T>
using Init = Signature<decltype(&T::init_context)>;
template <class T>
using Optimize = Signature<decltype(&T::optimize)>;
template <class T>
using Write = Signature<decltype(&T::write)>;

}  // namespace task_detail

template <class T>
using TaskConfig = typename task_detail::Init<T>::template Argument<0>;
template <class T>
using TaskContext = typename task_detail::Optimize<T>::template Argument<0>;
template <class T>
using TaskInput = typename task_detail::Optimize<T>::template Argument<1>;
template <class T>
using TaskOutput = typename task_detail::Unwrapped<typename task_detail::Optimize<T>::Return>::type;
template <class T>
using TaskMap = typename task_detail::Write<T>::template Argument<1>;

template <class T>
concept Task = requires {
  &T::init_context;
  &T::optimize;
  &T::write;
  &T::collect;
}
&&std::same_as<typename task_detail::Unwrapped<typename task_detail::Init<T>::Return>::type, TaskContext<T>>&&
    Transferable<TaskConfig<T>>&& Transferable<TaskInput<T>>&& Transferable<TaskOutput<T>>;

// What a task is to an executor: functions over bytes.
struct TaskOps {
  const char* name = "";
  bool context_travels = false;
  // A context of an encoded config, or of one that travelled. Throws std::bad_alloc, and nothing else, as optimize
  // does.
  Result<void*> (*make_context)(std::span<const std::byte> config) = nullptr;
  Result<void*> (*receive_context)(std::span<const std::byte> message) = nullptr;
  void (*send_context)(const void* context, Bytes& out) = nullptr;
  void (*destroy_context)(void* context) = nullptr;
  // One job. After an error the context is as it was before, where it can be copied or travels. May throw, as may the
  // others, where there is no memory or a copy throws.
  Result<void> (*optimize)(void* context, std::span<const std::byte> input, Bytes& output) = nullptr;
  // One input of two, in place of the first.
  Result<void> (*merge)(Bytes& waiting, std::span<const std::byte> newer) = nullptr;
};

namespace task_detail {

Error error_of_exception(const char* what);  // the text of whatever is being thrown, but bad_alloc

template <class T>
Result<T> wrapped(Result<T> r) {
  return r;
}
// What a task throws is its error, but for a lack of memory: that is its worker's affair, as is what is thrown in
// between (run_job).
template <class T, class F>
Result<T> guarded(F&& f) {
  try {
    return wrapped<T>(f());
  } catch (const std::bad_alloc&) {
    throw;
  } catch (...) {
    return error_of_exception("the task");
  }
}

// What a worker keeps from job to job: the context, and memory.
template <Task T>
struct Kept {
  std::unique_ptr<TaskContext<T>> context;
  TaskInput<T> input = {};
  Bytes before = {};  // the context of the job before, where it travels and cannot be copied
};

template <Task T>
Result<void*> make_context(std::span<const std::byte> message) {
  TaskConfig<T> config;
  if (auto ok = decode(message, config); !ok) return ok.error();
  auto made = guarded<TaskContext<T>>([&] { return T::init_context(config); });
  if (!made) return made.error();
  return static_cast<void*>(new Kept<T>{std::make_unique<TaskContext<T>>(std::move(*made))});
}
template <Task T>
Result<void*> receive_context(std::span<const std::byte> message) {
  if constexpr (Transferable<TaskContext<T>>) {
    auto context = std::make_unique<TaskContext<T>>();
    if (auto ok = decode(message, *context); !ok) return ok.error();
    return static_cast<void*>(new Kept<T>{std::move(context)});
  } else {
    return Error{ErrorCode::bad_input, "a context of this task cannot travel"};
  }
}
template <Task T>
void send_context(const void* context, Bytes& out) {
  if constexpr (Transferable<TaskContext<T>>) encode(*static_cast<const Kept<T>*>(context)->context, out);
}
template <Task T>
Result<void> optimize(void* context, std::span<const std::byte> message, Bytes& out) {
  using Context = TaskContext<T>;
  auto& [now, input, bytes] = *static_cast<Kept<T>*>(context);
  if (auto ok = decode(message, input); !ok) return ok;
  std::unique_ptr<Context> before;
  if constexpr (std::copy_constructible<Context>)
    before = std::make_unique<Context>(*now);
  else if constexpr (Transferable<Context>)
    encode(*now, bytes);
  const auto put_back = [&] {
    if constexpr (!std::copy_constructible<Context> && Transferable<Context>) {
      before = std::make_unique<Context>();
      static_cast<void>(decode(std::span<const std::byte>(bytes), *before));  // it was encoded here
    }
    if (before != nullptr) now = std::move(before);
  };
  try {
    auto output = guarded<TaskOutput<T>>([&c = *now, &in = input] { return T::optimize(c, in); });
    if (output) {
      encode(*output, out);
      return {};
    }
    put_back();
    return output.error();
  } catch (...) {
    put_back();
    throw;
  }
}
template <Task T>
Result<void> merge(Bytes& waiting, std::span<const std::byte> newer) {
  if constexpr (requires(const TaskInput<T>& in) { T::merge(in, in); }) {
    TaskInput<T> a, b;
    if (auto ok = decode(waiting, a); !ok) return ok;
    if (auto ok = decode(newer, b); !ok) return ok;
    Bytes merged;
    encode(T::merge(a, b), merged);
    waiting = std::move(merged);
  } else {
    waiting.assign(newer.begin(), newer.end());
  }
  return {};
}
template <class T>
constexpr const char* name_of() {
  if constexpr (requires { T::kName; })
    return T::kName;
  else
    return "task";
}

}  // namespace task_detail

template <Task T>
inline constexpr TaskOps kTaskOps = {
    task_detail::name_of<T>(),     Transferable<TaskContext<T>>,
    &task_detail::make_context<T>, &task_detail::receive_context<T>,
    &task_detail::send_context<T>, [](void* context) { delete static_cast<task_detail::Kept<T>*>(context); },
    &task_detail::optimize<T>,     &task_detail::merge<T>};

}  // namespace oriel
