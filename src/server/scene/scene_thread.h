// The scene thread: applies commands in order, builds geometry off the loop, publishes snapshots to the
// servo.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "base/thread.h"
#include "scene/builder.h"
#include "scene/snapshot_slot.h"
#include "server/scene/scene_queue.h"

namespace hapticd::server {

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

/// Owns one scene and the thread that drives it: a builder for each device, because workspace and passivity
/// bound differ; all builders get the same commands. The net thread pushes into queue() and wakes the thread; the
/// callbacks run in the scene thread and must only pass things on.
class SceneThread {
 public:
  struct Callbacks {
    std::function<void(std::vector<scene::Notice>&&)> notices;  ///< texts for clients
    std::function<void(scene::ClientId)> relieved;              ///< the client is no longer full
    /// Before the builders get a command; null: the client is gone. Empty unless somebody records.
    std::function<void(scene::ClientId, base::Nanos, const scene::SceneCommand*)> applying;
  };

  /// Commands are applied in slices of about this size, with a publication after each.
  static constexpr std::size_t kSlice_bytes = 1U << 20;

  /// At least one device; their slots outlive this.
  SceneThread(std::vector<SceneDevice> devices, Callbacks callbacks);
  ~SceneThread();
  SceneThread(const SceneThread&) = delete;
  SceneThread& operator=(const SceneThread&) = delete;

  /// Publishes the empty scene to all devices and starts the thread.
  void start();
  /// Applies what is queued and ends the thread. Idempotent.
  void stop();

  /// Appends a parcel; never waits for the scene. From any thread.
  void push(SceneParcel&& parcel);
  /// The same for a task that goes before all that are queued.
  void pushUrgent(SceneTask&& task);
  const SceneQueue& queue() const noexcept { return queue_; }

 private:
  // One device's builder.
  struct Seat {
    SceneDevice device;
    scene::SceneBuilder builder;
  };
  struct Waiting {
    base::Nanos since;  // edits up to then must be published
    std::function<void()> reached;
  };

  std::optional<base::Nanos> step();
  void applySlice();
  void apply(SceneParcel& parcel);
  void apply(SceneTask&& task);
  void publish();
  void publishTo(Seat& seat);
  void answerQuestions();
  std::optional<base::Nanos> oldestEdit() const;
  void callWaiting(std::optional<base::Nanos> oldestEdit);
  std::optional<base::Nanos> nextDeadline() const;

  std::vector<Seat> seats_;
  Callbacks callbacks_;
  std::vector<scene::Notice> notices_;
  std::vector<DescribeScene> questions_;
  std::vector<Waiting> waiting_;
  std::optional<base::Nanos> collectAt_;

  SceneQueue queue_;
  base::Thread thread_;
};

}  // namespace hapticd::server
