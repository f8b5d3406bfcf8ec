// A low-priority thread for work that another thread must not wait for.
#pragma once

#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "base/thread.h"

namespace hapticd::base {

/// Runs jobs one at a time, at niceness 10: in the order in which they were posted, or in turn by those who
/// asked for them.
class Worker {
 public:
  using Job = std::function<void()>;
  using OnFailure = std::function<void(const std::exception&)>;

  /// `name`: of the thread, at most 15 bytes.
  explicit Worker(std::string name) : name_(std::move(name)) {}
  ~Worker() { stop(); }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// Always from the same thread; the first call starts the worker. `onFailure` is told, in the worker's
  /// thread, of an exception that leaves the job.
  void post(Job job, OnFailure onFailure = {}) { postFor(0, std::move(job), std::move(onFailure)); }
  /// The same. One job of each `asker` runs in turn, so that nobody waits for all of another's.
  void postFor(std::uint32_t asker, Job job, OnFailure onFailure = {});
  /// Waits for the running job and discards the others; jobs that are posted afterwards are discarded, too.
  /// Idempotent.
  void stop();

 private:
  struct Task {
    Job run;
    OnFailure onFailure;
  };

  std::optional<Nanos> step();
  std::optional<Task> next();

  const std::string name_;
  std::mutex mutex_;
  std::map<std::uint32_t, std::deque<Task>> tasks_;  // by asker; no empty queues
  std::uint32_t last_ = 0;                           // asker of the last task
  bool stopped_ = false;
  Thread thread_;  // last: its step uses the others
};

}  // namespace hapticd::base
