#include "base/worker.h"

#include <utility>

namespace hapticd::base {

void Worker::postFor(std::uint32_t asker, Job job, OnFailure onFailure) {
  {
    const std::lock_guard lock(mutex_);
    if (stopped_) return;
    tasks_[asker].push_back({std::move(job), std::move(onFailure)});
  }
  if (thread_.running()) {
    thread_.wake();
  } else {
    thread_ = Thread({.name = name_, .niceness = 10}, [this] { return step(); });
  }
}

void Worker::stop() {
  std::map<std::uint32_t, std::deque<Task>> discarded;  // their destructors may take long
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    discarded.swap(tasks_);
  }
  thread_.stop();
}

std::optional<Nanos> Worker::step() {
  while (const auto task = next()) {
    try {
      task->run();
    } catch (const std::exception& error) {
      if (task->onFailure) task->onFailure(error);
    }
  }
  return std::nullopt;
}

std::optional<Worker::Task> Worker::next() {
  const std::lock_guard lock(mutex_);
  if (tasks_.empty()) return std::nullopt;
  auto queue = tasks_.upper_bound(last_);
  if (queue == tasks_.end()) queue = tasks_.begin();
  last_ = queue->first;
  std::optional<Task> task = std::move(queue->second.front());
  queue->second.pop_front();
  if (queue->second.empty()) tasks_.erase(queue);
  return task;
}

}  // namespace hapticd::base
