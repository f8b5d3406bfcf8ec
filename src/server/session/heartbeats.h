// Clients that asked to be missed: who sends no heartbeat any more counts as lost.
#pragma once

#include <map>
#include <vector>

#include "base/time.h"
#include "geometry/types.h"
#include "scene/notice.h"

namespace hapticd::server {

/// Net thread.
class Heartbeats {
 public:
  static constexpr base::Nanos kLimit = 500'000'000;

  void beat(scene::ClientId client, base::Nanos now) { last_[client] = now; }
  void forget(scene::ClientId client) { last_.erase(client); }
  /// Those whose last heartbeat is too old; forgotten with this.
  std::vector<scene::ClientId> lost(base::Nanos now) {
    std::vector<scene::ClientId> gone;
    for (const auto& [client, time] : last_) {
      if (now - time > kLimit) gone.push_back(client);
    }
    for (const scene::ClientId client : gone) last_.erase(client);
    return gone;
  }

 private:
  std::map<scene::ClientId, base::Nanos> last_;
};

}  // namespace hapticd::server
