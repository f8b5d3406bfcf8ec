// The queue from the net thread to a scene thread. It charges each client for the bytes of its commands until
// they are applied, so that only the client that is ahead of the scene has to wait.
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

/// The tasks of one client from one read.
struct SceneParcel {
  scene::ClientId client = 0;
  std::vector<SceneTask> tasks;
  std::size_t bytes = 0;
  bool beforeOthers = false;  ///< what other clients have queued waits for it
};

/// In order for each client; clients take turns, so that one with much work does not delay the others. What
/// the server asks itself, as client 0, waits for nobody.
/// Thread-safe; no call waits for the scene.
class SceneQueue {
 public:
  /// A client with more bytes than this in the queue is full: its session holds back further scene commands.
  static constexpr std::size_t kClientLimit_bytes = 8U << 20;
  /// A full client is relieved when it has at most this many bytes in the queue.
  static constexpr std::size_t kRelief_bytes = kClientLimit_bytes / 2;

  /// Appends a parcel and charges its client.
  void push(SceneParcel&& parcel);
  /// The same, ahead of all clients.
  void pushFront(SceneParcel&& parcel);

  /// Whether the client exceeded the limit and is not yet relieved.
  bool full(scene::ClientId client) const;
  /// Bytes in the queue by client.
  std::map<scene::ClientId, std::size_t> waiting() const;
  /// Whether a command of the client is not yet published.
  bool pending(scene::ClientId client) const;

  /// The oldest parcel of the client whose turn it is; its bytes stay charged until done().
  std::optional<SceneParcel> take();
  /// A parcel of the client was applied at `now`. Returns true when this relieves the client.
  bool done(scene::ClientId client, std::size_t bytes, base::Nanos now);
  /// All commands applied before `oldestEdit` are published; all applied commands when it is empty.
  void published(std::optional<base::Nanos> oldestEdit);
  bool empty() const;

 private:
  struct Account {
    std::deque<SceneParcel> queued;
    std::size_t bytes = 0;
    std::size_t parcels = 0;  // not yet applied
    base::Nanos appliedAt = 0;
    bool full = false;
  };

  Account& charge(const SceneParcel& parcel);
  bool waits(scene::ClientId client) const;

  mutable std::mutex mutex_;
  std::deque<SceneParcel> urgent_;
  std::deque<scene::ClientId> turns_;            // clients with queued parcels, the next one first
  std::map<scene::ClientId, Account> accounts_;  // clients with unpublished commands
  std::deque<scene::ClientId> before_;           // whose parcels the others wait for, the next one first
};

}  // namespace hapticd::server
