// The server: accepts clients, passes their messages to stations and scenes, and sends reports to the
// clients.
//
// Everything runs in the net thread, which never waits for a scene or a servo.
#pragma once

#include <atomic>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "base/world.h"
#include "net/loop.h"
#include "net/tcp_listener.h"
#include "net/udp_socket.h"
#include "record/recorder.h"
#include "server/config/config.h"
#include "server/player.h"
#include "server/scene/scene_host.h"
#include "server/session/session.h"
#include "server/session/throttled_log.h"
#include "server/session/wall_clock.h"
#include "server/station/station.h"
#include "server/web/web_server.h"

namespace hapticd::server {

class Server final : public SessionOwner, public WebOwner {
 public:
  /// Opens the devices and the ports. Throws ConfigError, net::Error or std::runtime_error with a remedy in
  /// the text.
  explicit Server(const ServerConfig& config);
  /// Serves a recording; `config` is that of the player, possibly with another address. Opens no device and
  /// refuses all commands of clients.
  Server(const ServerConfig& config, std::unique_ptr<Player> player);
  ~Server() override;

  /// Serves until stop() or until the configured seconds are over.
  void run();
  /// From any thread, including one that waits for signals.
  void stop();
  /// From any thread, without the help of any other: stops the forces of all devices until a re-arm. Waits
  /// until the servos have written zero; false when one has not for 40 ms (the watchdog then ends the force).
  bool stopForces() noexcept;
  /// From any thread: run() has ended the forces and closed all devices.
  bool devicesClosed() const noexcept { return devicesClosed_.load(std::memory_order_acquire); }

  /// The endpoint of the listener, with the actual port.
  const net::Endpoint& address() const noexcept { return listener_->local(); }
  /// The endpoint of the viewer, with the actual port; empty when there is no viewer.
  std::optional<net::Endpoint> webAddress() const;
  /// Stations in the order of the configuration.
  const std::vector<std::unique_ptr<Station>>& stations() const noexcept { return stations_; }

 private:
  struct ReverseConnection;

  void onSubscribed(Session& session, wire::LocalSender name) override;
  void onMessage(Session& session, const wire::MessageReceived& message, base::Nanos received) override;
  void onWarning(const Session& session, const std::string& text) override;
  void onNote(const Session& session, const std::string& text) override;
  void onReadSlice() override;
  void onReadEnd(Session& session) override;
  void onPeerGone(Session& session, const std::string& reason) override;
  void onClosed(Session& session, const std::string& reason) override;

  ServerStatus status() const override;
  void onWebClient(net::Connection connection) override;

  void admit(Session& session);
  bool mayOnlyStop(const Session& session) const noexcept;
  void addSession(net::Connection connection, std::unique_ptr<net::UdpSocket> udp, SessionMode mode);
  void onUdpRequest(std::span<const std::byte> datagram, const net::Endpoint& from);
  void connectToClient(const net::Endpoint& client);
  void openDevice(const DeviceConfig& device);
  void openWeb();
  SceneHost& sceneFor(const DeviceConfig& device);
  void startScene(SceneHost& scene);
  void startPlaying();
  void startRecording();
  void finishRecording();
  void everySecond();
  void report(Station& station);
  void sendText(const Station& station, const wire::Text& text);
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
  std::unique_ptr<Player> player_;              ///< null unless a recording is replayed
  std::unique_ptr<record::Recorder> recorder_;  ///< null unless recording; outlives scenes and stations
  std::vector<std::unique_ptr<SceneHost>> scenes_;
  std::vector<std::unique_ptr<Station>> stations_;
  std::map<scene::ClientId, std::unique_ptr<Session>> sessions_;
  std::map<std::string, std::size_t> sessionsOf_;      ///< number by address
  std::deque<scene::ClientId> reserve_;                ///< clients beyond the limits, oldest first
  std::map<scene::ClientId, base::Nanos> handshakes_;  ///< start times of unfinished handshakes
  scene::ClientId refusalSentTo_ = 0;  ///< client already notified of a refusal during this read; 0: none
  std::vector<std::unique_ptr<ReverseConnection>> reverseConnections_;
  std::vector<net::Subscription> subscriptions_;
  std::unique_ptr<net::TcpListener> listener_;
  std::unique_ptr<net::UdpSocket> requests_;
  std::unique_ptr<WebServer> web_;
  scene::ClientId nextClient_ = 1;
  base::Nanos heartbeatsCheckedAt_ = base::now();
  std::atomic<bool> devicesClosed_{false};
  const base::Nanos started_ = base::now();
};

}  // namespace hapticd::server
