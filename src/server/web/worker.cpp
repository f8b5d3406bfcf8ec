#include "server/web/worker.h"

#include <spdlog/spdlog.h>

#include <exception>

namespace hapticd::server {

Worker::~Worker() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  thread_.stop();
}

void Worker::post(std::function<void()> job, std::function<void()> failed) {
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back({std::move(job), std::move(failed)});
  }
  if (thread_.running()) {
    thread_.wake();
  } else {
    thread_ = base::Thread({.name = name_, .niceness = 10}, [this] { return step(); });
  }
}

std::optional<base::Nanos> Worker::step() {
  for (;;) {
    Job job;
    {
      const std::lock_guard lock(mutex_);
      if (stopping_ || jobs_.empty()) return std::nullopt;
      job = std::move(jobs_.front());
      jobs_.pop_front();
    }
    try {
      job.run();
    } catch (const std::exception& error) {
      spdlog::error("web: {}", error.what());
      if (job.failed) job.failed();
    }
  }
}

}  // namespace hapticd::server
