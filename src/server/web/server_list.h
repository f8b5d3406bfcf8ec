// Answers requests for the servers of the network by as few searches as possible.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/time.h"
#include "server/web/network_servers.h"

namespace hapticd::server {

/// Net thread. One search at a time, and none for kFresh after the last: a page may ask as often as it likes.
class ServerList {
 public:
  static constexpr base::Nanos kFresh = 10'000'000'000;
  using Post = std::function<void(std::function<void()>)>;
  using Then = std::function<void(const std::string& json)>;

  /// `post`: calls a function in the net thread; from any thread.
  explicit ServerList(Post post) : post_(std::move(post)) {}
  ServerList(const ServerList&) = delete;
  ServerList& operator=(const ServerList&) = delete;

  /// Before the first get().
  void searchBy(std::unique_ptr<ServerFinder> finder) { finder_ = std::move(finder); }
  /// Calls back with the body of /api/servers: at once while the last search is fresh, otherwise after one.
  void get(Then then);

 private:
  void onFound(const std::string& json);

  Post post_;
  std::vector<Then> waiting_;  // for the search under way
  std::string json_;
  base::Nanos freshUntil_ = 0;            // 0: never searched
  std::unique_ptr<ServerFinder> finder_;  // last: its destructor ends the calls that use the others
};

}  // namespace hapticd::server
