// The server: listens, keeps the sessions, passes scene commands to the stations and their reports to the
// clients.
//
// Everything here runs in the net thread. It never waits for a scene or a servo.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "base/world.h"
#include "net/loop.h"
#include "net/tcp_listener.h"
#include "net/udp_socket.h"
#include "record/recorder.h"
#include "server/session/wall_clock.h"
#include "server/config/config.h"
#include "server/session/throttled_log.h"
#include "server/player.h"
#include "server/scene/scene_host.h"
#include "server/session/session.h"
#include "server/station/station.h"
#include "server/web/web_server.h"

namespace hapticd::server {

class Server final : public SessionOwner, public WebOwner {
 public:
  /// Opens the devices and the ports. Throws ConfigError, net::Error or std::runtime_error with a remedy in
  /// the text.
  explicit Server(const ServerConfig& config);
  /// Serves a recorded session: `config` is that of the player, perhaps with another address. No device is
  /// opened, and what clients want to change is refused.
  Server(const ServerConfig& config, std::unique_ptr<Player> player);
  ~Server() override;

  /// Serves until stop() or until the configured seconds are over.
  void run();
  /// From any thread, and from a signal handler's thread.
  void stop();

  /// Where it listens, with the real port.
  const net::Endpoint& address() const noexcept { return listener_->local(); }
  /// Where the page is served, with the real port; nothing when it is not.
  std::optional<net::Endpoint> webAddress() const;
  /// Stations in the order of the configuration.
  const std::vector<std::unique_ptr<Station>>& stations() const noexcept { return stations_; }

 private:
  struct ReverseConnection;

  void onSubscribed(Session& session, wire::LocalSender name) override;
  void onMessage(Session& session, const wire::MessageReceived& message, base::Nanos received) override;
  void onRemark(const Session& session, const std::string& text) override;
  void onReadSlice() override;
  void onReadEnd(Session& session) override;
  void onDeparted(Session& session, const std::string& reason) override;
  void onClosed(Session& session, const std::string& reason) override;

  ServerStatus status() const override;
  void onWebClient(net::Connection connection) override;

  void addSession(net::Connection connection, std::unique_ptr<net::UdpSocket> udp, SessionMode mode);
  void onUdpRequest(std::span<const std::byte> datagram, const net::Endpoint& from);
  void connectBack(const net::Endpoint& client);
  void openDevice(const DeviceConfig& device);
  void openWeb();
  SceneHost& sceneFor(const DeviceConfig& device);
  void startScene(SceneHost& scene);
  void startPlaying();
  void startRecording();
  void finishRecording();
  void everySecond();
  void report(Station& station);
  void tell(const Station& station, const wire::Text& text);
  void onSceneMessage(Session& session, Station& station, const wire::MessageReceived& message);
  void onRelieved(scene::ClientId client);
  void releaseForces(scene::ClientId client);
  void closeStaleHandshakes();
  void checkHeartbeats();
  bool mayCommand(Session& session, Station& station, const wire::MessageReceived& message);
  Station* stationOf(wire::LocalSender name) noexcept;
  wire::LocalSender nameFor(const Session& session, const SceneHost& scene) const noexcept;
  void deliver(const SceneHost& scene, std::vector<scene::Notice>&& notices);

  ServerConfig config_;
  net::Loop loop_;
  WallClock clock_;
  ThrottledLog throttledLog_;
  wire::LocalNames names_;
  std::unique_ptr<Player> player_;              ///< null: live
  std::unique_ptr<record::Recorder> recorder_;  ///< outlives who tells it
  std::vector<std::unique_ptr<SceneHost>> scenes_;
  std::vector<std::unique_ptr<Station>> stations_;
  std::map<scene::ClientId, std::unique_ptr<Session>> sessions_;
  std::map<scene::ClientId, base::Nanos> handshakes_;  ///< when the unfinished ones began
  scene::ClientId refusalSentTo_ = 0;  ///< whose commands of this read were refused; 0: nobody's
  std::vector<std::unique_ptr<ReverseConnection>> reverseConnections_;
  std::vector<net::Subscription> subscriptions_;
  std::unique_ptr<net::TcpListener> listener_;
  std::unique_ptr<net::UdpSocket> requests_;
  std::unique_ptr<WebServer> web_;
  scene::ClientId nextClient_ = 1;
  const base::Nanos started_ = base::now();
};

}  // namespace hapticd::server
