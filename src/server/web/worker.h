// A low-priority thread for work that the net thread must not wait for.
#pragma once

#include <deque>
#include <functional>
#include <mutex>
#include <string>

#include "base/thread.h"

namespace hapticd::server {

/// Runs jobs in order, one at a time, at niceness 10. The destructor waits for the running job and discards
/// queued ones.
class Worker {
 public:
  /// `name`: of the thread, at most 15 bytes.
  explicit Worker(std::string name) : name_(std::move(name)) {}
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// Always from the same thread; the first call starts the worker. An exception that leaves the job is
  /// logged; then `failed` is called in the worker's thread.
  void post(std::function<void()> job, std::function<void()> failed = {});

 private:
  std::optional<base::Nanos> step();

  const std::string name_;
  std::mutex mutex_;
  struct Job {
    std::function<void()> run;
    std::function<void()> failed;
  };
  std::deque<Job> jobs_;
  bool stopping_ = false;
  base::Thread thread_;  // last: its step uses the others
};

}  // namespace hapticd::server
