#include "server/web/worker.h"

#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <exception>

namespace hapticd::server {

Worker::~Worker() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_one();
  if (thread_.joinable()) thread_.join();
}

void Worker::post(std::function<void()> job) {
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back(std::move(job));
  }
  wake_.notify_one();
  if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
}

void Worker::run() {
  // Linux gives each thread a niceness of its own. A refusal changes nothing but the pace of others.
  ::setpriority(PRIO_PROCESS, 0, 10);
  for (;;) {
    std::function<void()> job;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [this] { return stopping_ || !jobs_.empty(); });
      if (stopping_) return;
      job = std::move(jobs_.front());
      jobs_.pop_front();
    }
    try {
      job();
    } catch (const std::exception& error) {
      spdlog::error("web: {}", error.what());
    }
  }
}

}  // namespace hapticd::server
