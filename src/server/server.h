// The server: accepts clients, passes their messages to stations and scenes, and sends reports to the
// clients.
//
// Everything runs in the net thread, which never waits for a scene or a servo.
#pragma once

#include <array>
#include <atomic>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "base/world.h"
#include "net/local_socket.h"
#include "net/loop.h"
#include "net/tcp_listener.h"
#include "server/compat/haply_port.h"
#include "server/config/config.h"
#include "server/player.h"
#include "server/recordings.h"
#include "server/scene/scene_host.h"
#include "server/session/admission.h"
#include "server/session/credentials.h"
#include "server/session/markers.h"
#include "server/session/reverse_connections.h"
#include "server/session/session.h"
#include "server/session/throttled_log.h"
#include "server/session/wall_clock.h"
#include "server/station/station.h"
#include "server/web/web_server.h"
#include "tls/tls.h"

namespace hapticd::server {

class Server final : public SessionOwner, public WebOwner, public HaplyOwner {
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
  /// From any thread: a person may feel a force of one of the devices.
  bool armed() const noexcept;
  /// Called by run() once the loops of all devices run. Before run().
  void onRunning(std::function<void()> function) { running_ = std::move(function); }
  /// Called in the net thread once per second from run() on: this process does not hang. Before run().
  void onAlive(std::function<void()> function) { alive_ = std::move(function); }
  /// Lets the page list the servers that `finder` finds. Before run().
  void searchNetworkBy(std::unique_ptr<ServerFinder> finder);
  /// From any thread: run() has ended the forces and closed all devices.
  bool devicesClosed() const noexcept { return devicesClosed_.load(std::memory_order_acquire); }

  /// The endpoint of the listener, with the actual port.
  const net::Endpoint& address() const noexcept { return listener_->local(); }
  /// Of the certificate for TLS; empty when TLS is off.
  std::string fingerprint() const { return tls_ ? tls_->fingerprint() : ""; }
  /// The endpoint of the viewer, with the actual port; empty when there is no viewer.
  std::optional<net::Endpoint> webAddress() const;
  /// The endpoint of the port for clients of Haply's service, with the actual port; empty when there is none.
  std::optional<net::Endpoint> haplyAddress() const;
  /// Stations in the order of the configuration.
  const std::vector<std::unique_ptr<Station>>& stations() const noexcept { return stations_; }

 private:
  void onConnected(Session& session) override;
  void onCaughtUp(Session& session) override;
  void onSubscribed(Session& session, wire::LocalSender name) override;
  void onMessage(Session& session, const wire::MessageReceived& message, base::Nanos received) override;
  void onWarning(const Session& session, const std::string& text) override;
  void onNote(const Session& session, const std::string& text) override;
  void onReadSlice() override;
  void onReadEnd(Session& session) override;
  void onPeerGone(Session& session, const std::string& reason) override;
  void onHeartbeatAgain(Session& session) override;
  void onEnding(Session& session) override;
  void onClosed(Session& session, const std::string& reason) override;

  ServerStatus status() const override;
  bool addClients(ServerStatus& status) const override;
  void onWebClient(net::Connection connection, std::string_view token, bool ofPage) override;
  std::optional<Refused> refuseHaply(const net::Endpoint& remote) override;
  Commander admitHaply(const net::Endpoint& remote) override;
  void onHaplyGone(const Commander& client, const std::string& reason) override;
  void onHaplyWarning(scene::ClientId client, const std::string& text) override;

  void openPorts();
  void openSocket();
  bool isNear(std::uint32_t address) const;
  bool isEncrypted(const Session& session) const;
  net::Connection secured(net::Connection connection) override;
  void onIdentify(Session& session, const wire::MessageReceived& message);
  void identify(Session& session, std::string_view token, wire::LocalSender name);
  Session& addSession(net::Connection connection, std::unique_ptr<net::UdpSocket> udp, SessionMode mode);
  void openDevice(const DeviceConfig& device);
  void openWeb();
  void openHaply();
  SceneHost& sceneFor(const DeviceConfig& device);
  void startScene(SceneHost& scene);
  void startPlaying();
  void onRecordingControl(Session& session, const wire::MessageReceived& message);
  void everySecond();
  void sendPresentStates();
  void report(Station& station);
  void sendText(const Station& station, const wire::Text& text);
  void onMarker(Session& session, const wire::MessageReceived& message, base::Nanos received);
  void onReplayControl(Session& session, const wire::MessageReceived& message);
  void sendMarkers(Session& session);
  void onSceneMessage(Session& session, Station& station, const wire::MessageReceived& message);
  void onRelieved(scene::ClientId client);
  std::map<scene::ClientId, std::size_t> waitingCommands() const;
  void checkClients();
  void checkNextClients(scene::ClientId last);
  void checkHeartbeat(Session& session, base::Nanos now);
  bool isPermitted(Session& session, Station& station, const wire::MessageReceived& message,
                   std::string& reason);
  bool mayCommand(Session& session, Station& station, const wire::MessageReceived& message);
  Station* stationOf(wire::LocalSender name) noexcept;
  wire::LocalSender nameFor(const Session& session, const SceneHost& scene) const noexcept;
  void deliver(const SceneHost& scene, std::vector<scene::Notice>&& notices);

  ServerConfig config_;
  net::Loop loop_;
  WallClock clock_;
  ThrottledLog throttledLog_;
  Credentials credentials_;
  std::optional<tls::Acceptor> tls_;  ///< empty: off
  std::vector<Subnet> trusted_;
  wire::LocalNames names_;
  std::unique_ptr<Player> player_;  ///< null unless a recording is replayed
  Recordings recordings_;           ///< outlives scenes and stations
  std::vector<std::unique_ptr<SceneHost>> scenes_;
  std::vector<std::unique_ptr<Station>> stations_;
  Sessions sessions_;
  Admission admission_{config_.limits, sessions_};
  std::set<Station*> unfinishedReports_;  ///< with clients that a pass has not reached yet
  Markers markers_;
  /// What a client heard last about a kind of message to a device that it may not send, and until when it
  /// does not hear it again.
  struct Refusal {
    std::string reason;
    base::Nanos until = 0;
    int times = 0;  ///< it was heard
  };
  std::map<scene::ClientId, std::map<std::pair<wire::LocalSender, wire::MessageKind>, Refusal>> refusals_;
  std::vector<net::Subscription> subscriptions_;
  std::unique_ptr<net::TcpListener> listener_;
  std::unique_ptr<net::LocalListener> localListener_;
  std::unique_ptr<ReverseConnections> reverseConnections_;
  std::unique_ptr<WebServer> web_;
  std::unique_ptr<HaplyPort> haply_;  ///< null unless configured
  scene::ClientId nextClient_ = 1;
  std::deque<scene::ClientId> describedNothing_;  ///< before the handshake was over
  base::Nanos checkedAt_ = base::now();           ///< the clients
  std::optional<scene::ClientId> checkedUpTo_;    ///< in the round at hand
  std::function<void()> running_;
  std::function<void()> alive_;
  std::atomic<bool> devicesClosed_{false};
  const base::Nanos started_ = base::now();
};

}  // namespace hapticd::server
