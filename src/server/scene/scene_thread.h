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

#include "base/time.h"
#include "scene/snapshot_slot.h"
#include "scene/builder.h"

namespace hapticd::server {

/// A client left: what it owns ramps out.
struct ClientGone {};

/// Somebody wants to look at the scene, after what was said so far. The answer comes in the scene thread.
struct DescribeScene {
  std::function<void(std::shared_ptr<const scene::SceneDescription>)> answer;
};

/// One thing for the scene to do, from one client.
struct SceneTask {
  scene::ClientId client = 0;
  std::variant<scene::SceneCommand, ClientGone, DescribeScene> what;
};

/// A device that touches the scene: what the scene must know of it, and where its snapshots go.
struct SceneDevice {
  scene::SceneConfig config;
  scene::SnapshotSlot* slot = nullptr;
  /// In the scene thread, after the slot has it.
  std::function<void(const std::shared_ptr<const scene::SceneSnapshot>&)> published;
  /// In the scene thread, before the slot has it: when the builder was asked, and the revision that came; 0:
  /// none. Empty unless somebody records.
  std::function<void(base::Nanos, std::uint64_t)> publishing;
};

/// Owns one scene and the thread that drives it: a builder for each device, because workspace and what is
/// passive differ, all told the same. enqueue() from the net thread; the callbacks run in the scene thread
/// and must only pass things on.
class SceneThread {
 public:
  struct Callbacks {
    std::function<void(std::vector<scene::Notice>&&)> notices;  ///< texts for clients
    std::function<void()> drained;                              ///< the queue is no longer full
    /// Before the builders are told; null: the client is gone. Empty unless somebody records.
    std::function<void(scene::ClientId, base::Nanos, const scene::SceneCommand*)> telling;
  };

  /// Tasks above this many bytes make full() true: the net thread then stops reading from its clients.
  static constexpr std::size_t kQueueLimit_bytes = 32U << 20;

  /// At least one device; their slots outlive this.
  SceneThread(std::vector<SceneDevice> devices, Callbacks callbacks);
  ~SceneThread();
  SceneThread(const SceneThread&) = delete;
  SceneThread& operator=(const SceneThread&) = delete;

  /// Publishes the empty scene to all devices and starts the thread.
  void start();
  /// Applies what is queued and ends the thread. Idempotent.
  void stop();

  /// Appends tasks in order; never waits for the scene. `bytes` is what they hold, for the limit.
  void enqueue(std::vector<SceneTask>&& tasks, std::size_t bytes);
  bool full() const;

 private:
  void run();
  // One device's builder.
  struct Seat {
    SceneDevice device;
    scene::SceneBuilder builder;
  };

  void apply(std::vector<SceneTask>& tasks);
  void tell(SceneTask&& task);
  void publish();
  void answerQuestions();
  void publishTo(Seat& seat);
  std::optional<base::Nanos> nextDeadline() const;

  std::vector<Seat> seats_;
  Callbacks callbacks_;
  std::vector<scene::Notice> notices_;
  std::vector<DescribeScene> questions_;
  std::optional<base::Nanos> collectAt_;

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<SceneTask> queue_;
  std::size_t queuedBytes_ = 0;
  bool wasFull_ = false;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace hapticd::server
