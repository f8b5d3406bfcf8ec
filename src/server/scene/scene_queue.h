// The queue from the net thread to a scene thread. It knows who fills it: each client is charged for the bytes of its
// commands until they are applied, so that only the client that is ahead has to wait.
#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "base/time.h"
#include "server/scene/scene_task.h"

namespace hapticd::server {

/// What one client sent in one read.
struct SceneParcel {
  scene::ClientId client = 0;
  std::vector<SceneTask> tasks;
  std::size_t bytes = 0;
};

/// First in, first out over all clients. Thread-safe; no call waits for the scene.
class SceneQueue {
 public:
  /// A client that has more than this in the queue is full: its session holds back further scene commands.
  static constexpr std::size_t kClientLimit_bytes = 8U << 20;
  /// A full client is relieved when it is down to this.
  static constexpr std::size_t kRelief_bytes = kClientLimit_bytes / 2;

  /// Appends a parcel and charges its client.
  void push(SceneParcel&& parcel);
  /// The same, but the parcel is the next to be taken.
  void pushFront(SceneParcel&& parcel);

  /// Whether the client is full: above the limit, and since then not yet relieved.
  bool full(scene::ClientId client) const;
  /// Whether something of the client is not yet published.
  bool pending(scene::ClientId client) const;

  /// The oldest parcel; its bytes stay charged until done().
  std::optional<SceneParcel> take();
  /// The parcel was applied at `now`. True when this relieved its client.
  bool done(scene::ClientId client, std::size_t bytes, base::Nanos now);
  /// Everything applied before `oldestEdit` is published; everything at all when it is empty.
  void published(std::optional<base::Nanos> oldestEdit);
  bool empty() const;

 private:
  struct Account {
    std::size_t bytes = 0;
    std::size_t parcels = 0;  // not applied
    base::Nanos appliedAt = 0;
    bool full = false;
  };

  void charge(const SceneParcel& parcel);

  mutable std::mutex mutex_;
  std::deque<SceneParcel> parcels_;
  std::map<scene::ClientId, Account> accounts_;  // of clients with something not published
};

}  // namespace hapticd::server
