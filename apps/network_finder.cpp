#include "network_finder.h"

#include <utility>

#include "zeroconf/background_search.h"
#include "zeroconf/find_servers.h"

namespace hapticd::apps {
namespace {

class NetworkFinder final : public server::ServerFinder {
 public:
  explicit NetworkFinder(const net::Endpoint& listening) : listening_(listening) {}

  void find(Done done) override {
    search_.start([this, done = std::move(done)](const std::vector<zeroconf::AnnouncedServer>& found,
                                                 std::string reason) {
      server::NetworkSearch search{.reason = std::move(reason)};
      for (const zeroconf::AnnouncedServer& server : found) search.servers.push_back(shown(server));
      done(std::move(search));
    });
  }

 private:
  server::NetworkServer shown(const zeroconf::AnnouncedServer& found) const {
    server::NetworkServer server{.name = found.name,
                                 .address = found.address,
                                 .port = found.port,
                                 .page = found.page(),
                                 .tls = found.tls,
                                 .version = found.version,
                                 .thisServer = zeroconf::listensAt(listening_, found)};
    for (const std::string& device : found.devices) server.devices.push_back(found.client(device));
    return server;
  }

  net::Endpoint listening_;
  zeroconf::BackgroundSearch search_;
};

}  // namespace

void listNetworkOnPage(server::Server& server) {
  server.searchNetworkBy(std::make_unique<NetworkFinder>(server.address()));
}

}  // namespace hapticd::apps
