// Searches for servers in a thread that the caller does not wait for.
#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "base/thread.h"
#include "zeroconf/announced_server.h"

namespace hapticd::zeroconf {

/// findServers() in a thread of its own, which the first search starts.
class BackgroundSearch {
 public:
  /// `reason`: why the network could not be searched, with the remedy; empty when it was.
  using Done = std::function<void(std::vector<AnnouncedServer> servers, std::string reason)>;

  BackgroundSearch();
  /// Ends the search: at once, or after some seconds when the daemon hangs. `done` may be called until then.
  ~BackgroundSearch();
  BackgroundSearch(const BackgroundSearch&) = delete;
  BackgroundSearch& operator=(const BackgroundSearch&) = delete;

  /// Never waits. Calls `done` once, in the search's thread. Call it again only after that.
  void start(Done done);

 private:
  void run();

  int stopFd_;
  int startFd_;
  std::mutex mutex_;
  Done done_;
  base::BlockingThread thread_;
};

}  // namespace hapticd::zeroconf
