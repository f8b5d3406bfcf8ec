// The web port: the page, the VRPN stream for it as a WebSocket, the state of everything, metrics.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "net/http_server.h"
#include "server/web/server_status.h"
#include "server/web/access.h"
#include "server/web/mesh_store.h"
#include "server/web/picture.h"
#include "server/web/scene_watch.h"
#include "server/web/worker.h"

namespace hapticd::server {

/// What the web port needs of the server. Called from the net thread.
class WebOwner {
 public:
  virtual ~WebOwner() = default;
  virtual ServerStatus status() const = 0;
  /// A page has opened a VRPN stream.
  virtual void onWebClient(net::Connection connection) = 0;
};

/// Net thread; texts and meshes are made in workers of its own. Destroy it after the scenes have stopped and
/// before the loop.
class WebServer {
 public:
  /// `allowed` are further names that the port may be called by. Throws net::Error.
  WebServer(net::Loop& loop, const net::Endpoint& local, const std::vector<std::string>& allowed,
            const net::ConnectionOptions& connection, WebOwner& owner, std::vector<SceneHost*> scenes);
  ~WebServer();

  /// Where it listens, with the real port.
  const net::Endpoint& local() const noexcept { return http_.local(); }
  /// Frees what nobody has looked at for a while. Call it about once a second.
  void everySecond();

 private:
  using TextOf = std::string (*)(const Picture&);

  void onRequest(const net::HttpRequest& request, const net::HttpReply& reply);
  void route(const net::HttpRequest& request, const net::HttpReply& reply);
  void sendPicture(const net::HttpReply& reply, TextOf text, const char* contentType);
  void sendMesh(const net::HttpRequest& request, const net::HttpReply& reply);
  bool findMesh(std::size_t scene, std::int64_t object, std::uint64_t geometry, const net::HttpReply& reply,
                std::string& why);
  Picture picture();
  void respond(const net::HttpReply& reply, net::HttpResponse response) const;

  net::Loop& loop_;
  WebOwner& owner_;
  int idleSeconds_ = 0;
  Worker textWorker_;
  Worker meshWorker_;
  SceneWatch watch_;
  MeshStore meshes_;
  net::HttpServer http_;
  WebAccess access_;
};

}  // namespace hapticd::server
