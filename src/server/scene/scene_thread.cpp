#include "server/scene/scene_thread.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>

#include "base/world.h"

namespace hapticd::server {
namespace {

constexpr base::Nanos kCollectAfter = 50'000'000;

// What every device's builder says is said once.
void mergeNotices(std::vector<scene::Notice>&& from, std::vector<scene::Notice>& into) {
  for (scene::Notice& notice : from) {
    const auto same = [&](const scene::Notice& known) {
      return known.client == notice.client && known.text == notice.text;
    };
    if (std::none_of(into.begin(), into.end(), same)) into.push_back(std::move(notice));
  }
}

}  // namespace

SceneThread::SceneThread(std::vector<SceneDevice> devices, Callbacks callbacks)
    : callbacks_(std::move(callbacks)) {
  for (SceneDevice& device : devices) {
    scene::SceneBuilder builder(device.config);
    seats_.push_back({std::move(device), std::move(builder)});
  }
}

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
      const std::optional<base::Nanos> deadline = nextDeadline();
      if (deadline) {
        wake_.wait_for(
            lock, std::chrono::nanoseconds(std::max<base::Nanos>(*deadline - base::now(), 0)), ready);
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
    answerQuestions();
  }
}

std::optional<base::Nanos> SceneThread::nextDeadline() const {
  std::optional<base::Nanos> next = collectAt_;
  for (const Seat& seat : seats_) {
    const auto deadline = seat.builder.nextDeadline();
    if (deadline && (!next || *deadline < *next)) next = deadline;
  }
  return next;
}

void SceneThread::apply(std::vector<SceneTask>& tasks) {
  for (SceneTask& task : tasks) {
    try {
      tell(std::move(task));
    } catch (const std::exception& error) {
      notices_.push_back(
          {task.client, scene::Notice::Severity::error, std::string("not done: ") + error.what()});
    }
  }
}

void SceneThread::tell(SceneTask&& task) {
  if (auto* question = std::get_if<DescribeScene>(&task.what)) {
    questions_.push_back(std::move(*question));
    return;
  }
  const base::Nanos now = base::now();
  auto* command = std::get_if<scene::SceneCommand>(&task.what);
  if (callbacks_.telling) callbacks_.telling(task.client, now, command);
  std::vector<scene::Notice> again;
  for (std::size_t i = seats_.size(); i-- > 0;) {
    scene::SceneBuilder& builder = seats_[i].builder;
    if (command == nullptr) {
      builder.clientGone(task.client, now);
    } else if (i > 0) {
      builder.apply(task.client, scene::SceneCommand(*command), now, again);
    } else {
      builder.apply(task.client, std::move(*command), now, notices_);
    }
  }
  mergeNotices(std::move(again), notices_);
}

void SceneThread::publish() {
  collectAt_.reset();
  for (Seat& seat : seats_) {
    try {
      publishTo(seat);
    } catch (const std::exception& error) {
      // Out of memory, or the index could not be built: the scene that is felt stays as it is.
      spdlog::error("the scene could not be published: {}", error.what());
    }
  }
  if (!notices_.empty() && callbacks_.notices) callbacks_.notices(std::exchange(notices_, {}));
}

// All seats have the same scene, but for what is passive on each device.
void SceneThread::answerQuestions() {
  if (questions_.empty()) return;
  try {
    const auto description =
        std::make_shared<const scene::SceneDescription>(seats_.front().builder.describe());
    for (const DescribeScene& question : questions_) question.answer(description);
  } catch (const std::exception& error) {
    spdlog::error("the scene could not be described: {}", error.what());
  }
  questions_.clear();
}

void SceneThread::publishTo(Seat& seat) {
  std::vector<scene::Notice> said;
  const base::Nanos now = base::now();
  std::shared_ptr<const scene::SceneSnapshot> snapshot;
  // First, so that the builder can refit the index that the servo gave back instead of building a new one.
  seat.device.slot->collect();
  try {
    snapshot = seat.builder.publish(now, said);
  } catch (...) {
    if (seat.device.publishing) seat.device.publishing(now, 0);
    throw;
  }
  if (seat.device.publishing) seat.device.publishing(now, snapshot ? snapshot->revision : 0);
  mergeNotices(std::move(said), notices_);
  if (!snapshot) return;
  seat.device.slot->publish(snapshot);
  collectAt_ = base::now() + kCollectAfter;
  if (seat.device.published) seat.device.published(snapshot);
}

}  // namespace hapticd::server
