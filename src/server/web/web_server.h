// The HTTP port: the viewer, its VRPN stream over a WebSocket, the server's state as JSON, metrics.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/worker.h"
#include "base/world.h"
#include "net/http_server.h"
#include "server/web/access.h"
#include "server/web/mesh_store.h"
#include "server/web/scene_watch.h"
#include "server/web/server_list.h"
#include "server/web/server_status.h"
#include "server/web/state_report.h"

namespace hapticd::server {

/// What WebServer needs from the server. Called on the net thread.
class WebOwner {
 public:
  virtual ~WebOwner() = default;
  /// Without clients.
  virtual ServerStatus status() const = 0;
  /// Appends the next clients, at most 100, to a status; false when none is left. Others have their turn
  /// between two calls.
  virtual bool addClients(ServerStatus& status) const = 0;
  /// Somebody opened a WebSocket for a VRPN stream: with the token of its header `Authorization: Bearer`, or
  /// an empty one; `ofPage`: from a browser, which names the origin of its page.
  virtual void onWebClient(net::Connection connection, std::string_view token, bool ofPage) = 0;
  /// The connection with TLS around it where its address needs it; empty when it is refused.
  virtual net::Connection secured(net::Connection connection) = 0;
};

/// Net thread; it builds response texts and display meshes on two workers. Destroy it after the scenes have
/// stopped and before the loop.
class WebServer {
 public:
  /// `allowed` are further host names that requests may use. Throws net::Error when it cannot listen.
  WebServer(net::Loop& loop, const net::Endpoint& local, const std::vector<std::string>& allowed,
            const net::ConnectionOptions& connection, WebOwner& owner, std::vector<SceneHost*> scenes);
  ~WebServer();

  /// The listening address, with the port that the system chose for port 0.
  const net::Endpoint& local() const noexcept { return http_.local(); }
  /// From now on /api/servers lists what `finder` finds. Before the loop runs.
  void searchNetworkBy(std::unique_ptr<ServerFinder> finder) { servers_.searchBy(std::move(finder)); }
  /// Frees scene descriptions after 10 s without a request. Call it about once a second.
  void everySecond();

 private:
  using Format = std::string (*)(const StateReport&);
  struct Asker {
    net::HttpReply reply;
    Format format;
    const char* contentType;
  };

  void onRequest(const net::HttpRequest& request, const net::HttpReply& reply);
  void route(const net::HttpRequest& request, const net::HttpReply& reply);
  void sendState(const net::HttpReply& reply, Format format, const char* contentType);
  void nextReport();
  void gather();
  void answer();
  void sendMesh(const net::HttpRequest& request, const net::HttpReply& reply);
  bool findMesh(std::size_t scene, std::int64_t object, std::uint64_t geometry, const net::HttpReply& reply,
                std::string& error);
  void sendServers(const net::HttpReply& reply);
  void addScenes();
  void respond(const net::HttpReply& reply, net::HttpResponse response) const;

  net::Loop& loop_;
  WebOwner& owner_;
  int idleSeconds_ = 0;
  std::vector<Asker> askers_;     // for the next report
  std::vector<Asker> answering_;  // with the present one
  bool reporting_ = false;
  StateReport report_;    // being made
  base::Nanos cost_ = 0;  // of this thread, for it
  base::Nanos nextReport_ = 0;
  net::Subscription reportTimer_;
  base::Worker textWorker_{"web-text"};
  base::Worker meshWorker_{"web-mesh"};
  SceneWatch watch_;
  MeshStore meshes_;
  ServerList servers_;
  net::HttpServer http_;
  WebAccess access_;
};

}  // namespace hapticd::server
