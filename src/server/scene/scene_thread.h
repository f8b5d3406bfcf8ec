// The scene thread: applies commands in order, builds the geometry outside the servo loop and publishes
// snapshots.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/thread.h"
#include "scene/builder.h"
#include "scene/snapshot_slot.h"
#include "server/scene/scene_queue.h"
#include "server/scene/shared_stopwatch.h"

namespace hapticd::server {

/// A device at the scene: its configuration and the slot of its snapshots.
struct SceneDevice {
  scene::SceneConfig config;
  scene::SnapshotSlot* slot = nullptr;
  /// Scene thread; called after the snapshot was passed to the slot.
  std::function<void(const std::shared_ptr<const scene::SceneSnapshot>&)> published;
  /// Scene thread; called before a snapshot is passed to the slot, with the time at which the builder was
  /// asked, the revision that it returned, 0 for none, and its readings of stopwatch and clock. May be empty.
  std::function<void(base::Nanos, std::uint64_t, const std::vector<base::Nanos>&)> publishing;
  std::string name = {};  ///< for texts about one of several devices
};

/// Owns one scene and its thread: one builder for each device, because workspace and passivity bound differ;
/// all builders get the same commands. Other threads push parcels; the callbacks run in the scene thread and
/// must return quickly.
class SceneThread {
 public:
  struct Callbacks {
    std::function<void(std::vector<scene::Notice>&&)> notices;  ///< texts for clients
    std::function<void(scene::ClientId)> relieved;              ///< the client is no longer full
    /// Called before the builders get a command; null: the client disconnected. May be empty.
    std::function<void(scene::ClientId, base::Nanos, const scene::SceneCommand*)> applying;
    /// The scene was reset; called before that is published. May be empty.
    std::function<void()> wasReset;
  };

  /// The thread applies about this many bytes of commands between publications.
  static constexpr std::size_t kSlice_bytes = 1U << 20;

  /// `devices` must not be empty; their slots must outlive this object.
  SceneThread(std::vector<SceneDevice> devices, Callbacks callbacks);
  ~SceneThread();
  SceneThread(const SceneThread&) = delete;
  SceneThread& operator=(const SceneThread&) = delete;

  /// Publishes the empty scene to all devices and starts the thread.
  void start();
  /// Applies the queued commands and ends the thread. Idempotent.
  void stop();

  /// Appends a parcel; never waits for the scene. From any thread.
  void push(SceneParcel&& parcel);
  /// Puts one task in front of all queued ones.
  void pushUrgent(SceneTask&& task);
  const SceneQueue& queue() const noexcept { return queue_; }

 private:
  // One device at the scene: its slot and its builder.
  struct Seat {
    SceneDevice device;
    scene::SceneBuilder builder;
    std::vector<scene::Notice> notices = {};  // of the command or publication at hand
  };
  struct PublishWaiter {
    base::Nanos since;  // edits up to this time must be published
    std::function<void()> reached;
  };

  std::optional<base::Nanos> step();
  void applySlice();
  void apply(SceneParcel& parcel);
  void apply(SceneTask&& task);
  void noteFailure(scene::ClientId client, const char* reason) noexcept;
  void publish();
  void publishTo(Seat& seat, base::Nanos now);
  void takeNotices(bool again);
  void describeScene();
  void inspect();
  std::optional<base::Nanos> oldestEdit() const;
  void callPublishWaiters(std::optional<base::Nanos> oldestEdit);
  std::optional<base::Nanos> nextDeadline() const;

  SharedStopwatch stopwatch_;
  std::vector<Seat> seats_;
  Callbacks callbacks_;
  std::vector<scene::Notice> notices_;
  std::vector<DescribeScene> descriptionRequests_;
  std::vector<Inspect> inspections_;
  std::vector<PublishWaiter> publishWaiters_;
  std::optional<base::Nanos> collectAt_;

  SceneQueue queue_;
  base::Thread thread_;
};

}  // namespace hapticd::server
