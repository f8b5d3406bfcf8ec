// The scene thread: applies commands in order, builds geometry off the loop, publishes snapshots to the
// servo.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <variant>
#include <vector>

#include "realtime/handoff/snapshot_slot.h"
#include "scene/builder.h"

namespace hapticd::server {

/// A client left: what it owns ramps out.
struct ClientGone {};

/// One thing for the scene to do, from one client.
struct SceneTask {
  scene::ClientId client = 0;
  std::variant<scene::SceneCommand, ClientGone> what;
};

/// Owns the builder of one scene and the thread that drives it. enqueue() from the net thread; the callbacks
/// run in the scene thread and must only pass things on.
class SceneThread {
 public:
  struct Callbacks {
    std::function<void(std::vector<scene::Notice>&&)> notices;  ///< texts for clients
    std::function<void(const std::shared_ptr<const scene::SceneSnapshot>&)>
        published;                  ///< after the slot has it
    std::function<void()> drained;  ///< the queue fell under half its limit
  };

  /// Tasks above this many bytes make full() true: the net thread then stops reading from its clients.
  static constexpr std::size_t kQueueLimit_bytes = 32U << 20;

  SceneThread(scene::SceneConfig config, realtime::SnapshotSlot& slot, Callbacks callbacks);
  ~SceneThread();
  SceneThread(const SceneThread&) = delete;
  SceneThread& operator=(const SceneThread&) = delete;

  /// Publishes the empty scene and starts the thread.
  void start();
  /// Applies what is queued and ends the thread. Idempotent.
  void stop();

  /// Appends tasks in order; never waits for the scene. `bytes` is what they hold, for the limit.
  void enqueue(std::vector<SceneTask>&& tasks, std::size_t bytes);
  bool full() const;

 private:
  void run();
  void apply(std::vector<SceneTask>& tasks);
  void publish();

  scene::SceneBuilder builder_;
  realtime::SnapshotSlot& slot_;
  Callbacks callbacks_;
  std::vector<scene::Notice> notices_;
  std::optional<geometry::Nanos> collectAt_;

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<SceneTask> queue_;
  std::size_t queuedBytes_ = 0;
  bool wasFull_ = false;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace hapticd::server
