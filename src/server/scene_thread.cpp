#include "server/scene_thread.h"

#include <spdlog/spdlog.h>

#include <chrono>

#include "server/clock.h"

namespace hapticd::server {
namespace {

constexpr geometry::Nanos kCollectAfter = 50'000'000;

}  // namespace

SceneThread::SceneThread(scene::SceneConfig config, realtime::SnapshotSlot& slot, Callbacks callbacks)
    : builder_(std::move(config)), slot_(slot), callbacks_(std::move(callbacks)) {}

SceneThread::~SceneThread() {
  stop();
}

void SceneThread::start() {
  publish();
  thread_ = std::thread([this] { run(); });
}

void SceneThread::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_one();
  if (thread_.joinable()) thread_.join();
}

void SceneThread::enqueue(std::vector<SceneTask>&& tasks, std::size_t bytes) {
  if (tasks.empty()) return;
  {
    const std::lock_guard lock(mutex_);
    if (queue_.empty()) {
      queue_ = std::move(tasks);
    } else {
      queue_.insert(queue_.end(), std::make_move_iterator(tasks.begin()),
                    std::make_move_iterator(tasks.end()));
    }
    queuedBytes_ += bytes;
    wasFull_ = wasFull_ || queuedBytes_ > kQueueLimit_bytes;
  }
  wake_.notify_one();
}

bool SceneThread::full() const {
  const std::lock_guard lock(mutex_);
  return wasFull_;
}

void SceneThread::run() {
  std::vector<SceneTask> tasks;
  for (;;) {
    bool relieved = false;
    {
      std::unique_lock lock(mutex_);
      const auto ready = [this] { return stopping_ || !queue_.empty(); };
      // After a change the servo soon gives back what it replaced, which may be a large mesh: wake once to
      // free it.
      std::optional<geometry::Nanos> deadline = builder_.nextDeadline();
      if (collectAt_ && (!deadline || *collectAt_ < *deadline)) deadline = collectAt_;
      if (deadline) {
        wake_.wait_for(
            lock, std::chrono::nanoseconds(std::max<geometry::Nanos>(*deadline - monotonicNow(), 0)), ready);
      } else {
        wake_.wait(lock, ready);
      }
      if (stopping_ && queue_.empty()) return;
      tasks.clear();
      tasks.swap(queue_);
      queuedBytes_ = 0;
      relieved = std::exchange(wasFull_, false);
    }
    if (relieved && callbacks_.drained) callbacks_.drained();
    apply(tasks);
    publish();
  }
}

void SceneThread::apply(std::vector<SceneTask>& tasks) {
  for (SceneTask& task : tasks) {
    const geometry::Nanos now = monotonicNow();
    auto* command = std::get_if<scene::SceneCommand>(&task.what);
    if (command == nullptr) {
      builder_.clientGone(task.client, now);
      continue;
    }
    try {
      builder_.apply(task.client, std::move(*command), now, notices_);
    } catch (const std::exception& error) {
      notices_.push_back(
          {task.client, scene::Notice::Severity::error, std::string("not done: ") + error.what()});
    }
  }
}

void SceneThread::publish() {
  try {
    collectAt_.reset();
    if (auto snapshot = builder_.publish(monotonicNow(), notices_)) {
      slot_.publish(snapshot);
      collectAt_ = monotonicNow() + kCollectAfter;
      if (callbacks_.published) callbacks_.published(snapshot);
    } else {
      slot_.collect();
    }
  } catch (const std::exception& error) {
    // Out of memory, or the index could not be built: the scene that is felt stays as it is.
    spdlog::error("the scene could not be published: {}", error.what());
  }
  if (!notices_.empty() && callbacks_.notices) callbacks_.notices(std::exchange(notices_, {}));
}

}  // namespace hapticd::server
