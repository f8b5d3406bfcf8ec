// A port that speaks as Haply's Inverse Service does, for programs written for that service: the first frame
// lists the devices, then each message is answered by one state frame.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "net/http_server.h"
#include "server/config/config.h"
#include "server/session/client_status.h"
#include "server/session/identity.h"
#include "server/station/station.h"
#include "server/web/access.h"

namespace hapticd::server {

/// What HaplyPort needs from the server. Called on the net thread.
class HaplyOwner {
 public:
  virtual ~HaplyOwner() = default;
  /// Whether a client from there is let in; otherwise the status and the reason for its request.
  struct Refused {
    int status = 0;
    std::string reason;
  };
  virtual std::optional<Refused> refuseHaply(const net::Endpoint& remote) = 0;
  /// A new client, which was not refused.
  virtual Commander admitHaply(const net::Endpoint& remote) = 0;
  /// The client is gone; its force has ended.
  virtual void onHaplyGone(const Commander& client, const std::string& reason) = 0;
  /// A line for the log that a client can cause at any rate: throttle it. `source` is the client.
  virtual void onHaplyWarning(scene::ClientId client, const std::string& text) = 0;
};

/// Net thread. A client's force is a held force: one client at a time, within the tank of energy, zero
/// `haply_hold_ms` after its last message.
class HaplyPort {
 public:
  static constexpr std::size_t kMostClients = 16;
  static constexpr std::size_t kMostUnanswered = 64;  ///< beyond it the client is not read

  /// All stations must outlive this object. Throws net::Error when it cannot listen.
  HaplyPort(net::Loop& loop, const net::Endpoint& local, const CompatConfig& config,
            const net::ConnectionOptions& connection, HaplyOwner& owner,
            const std::vector<std::unique_ptr<Station>>& stations);
  ~HaplyPort();

  const net::Endpoint& local() const noexcept { return http_.local(); }
  /// State and traffic of every client.
  std::vector<ClientStatus> status() const;
  /// Answers the messages that wait. Call it after each tick, and several times a second while there is none.
  void answer();

 private:
  struct Client;

  void onRequest(const net::HttpRequest& request, const net::HttpReply& reply);
  std::string refusal(const net::HttpRequest& request) const;
  void add(net::Connection connection);
  void onMessage(Client& client, std::string_view text);
  bool obey(Client& client, std::string_view text);
  void force(Client& client, Station& station, const geometry::Vec3& force_N);
  std::string frame(const Client& client, bool config) const;
  void gone(scene::ClientId id, const std::string& reason);

  const CompatConfig config_;
  HaplyOwner& owner_;
  const std::vector<std::unique_ptr<Station>>& stations_;
  std::map<scene::ClientId, std::unique_ptr<Client>> clients_;
  net::HttpServer http_;
  WebAccess access_;
};

}  // namespace hapticd::server
