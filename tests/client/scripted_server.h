// A small VRPN server for tests of clients: real sockets on 127.0.0.1 and its own thread. It stores every
// message that it receives, answers pings of its device, and sends what a test asks it to send.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "net/connection.h"
#include "net/loop.h"
#include "net/tcp_listener.h"
#include "net/udp_socket.h"
#include "wire/peer.h"

namespace hapticd::test {

struct ScriptedServerOptions {
  std::string device = "Phantom";
  std::uint16_t port = 0;  ///< 0: the system chooses
  std::uint32_t address = net::kLoopbackAddress;
  bool answersPings = true;
  bool reads = true;                                 ///< false: completes the handshake, then does not read
  std::optional<wire::Capabilities> capabilities{};  ///< the answer to QueryCapabilities, if set
  std::string greetingBytes{};                       ///< sent in place of the VRPN protocol, if not empty
};

/// The answer of a server of this project with all features of version 1.
wire::Capabilities allCapabilities();

/// A message as it arrived.
struct Received {
  wire::Message message;
  std::string sender;
  wire::Time time;
  bool byDatagram = false;
};

class ScriptedServer {
 public:
  explicit ScriptedServer(ScriptedServerOptions options = {});
  ~ScriptedServer();

  std::uint16_t port() const { return port_; }
  /// "Phantom@127.0.0.1:PORT" and "Phantom@tcp://127.0.0.1:PORT".
  std::string name() const { return options_.device + "@127.0.0.1:" + std::to_string(port_); }
  std::string tcpName() const { return options_.device + "@tcp://127.0.0.1:" + std::to_string(port_); }

  /// Sends a message of the device (or of another one) to all clients; by datagram where the connection has
  /// them.
  template <class M>
  void send(const M& message, wire::Time time = {1700000000, 250000}, const std::string& sender = {}) {
    run([this, message, time, sender] {
      const wire::LocalSender id = sender.empty() ? device_ : names_.addSender(sender);
      for (Session& session : sessions_) {
        if (session.peer) session.peer->send(time, id, message);
        push(session);
      }
    });
  }
  /// Sends a message of the device of a type that is not in the table.
  void sendOther(const std::string& type, const std::string& payload);
  /// Sends bytes that need not be VRPN.
  void sendRawBytes(const std::string& bytes);
  /// Closes all connections, as a stopped server does.
  void dropClients();
  /// Stops reading all open connections; later ones are read.
  void stopReading();
  /// Resumes reading all open connections.
  void startReading();
  /// From now on, pings are not answered.
  void ignorePings() { ignorePings_ = true; }
  /// Connections that are open now.
  std::size_t openConnections();

  /// Waits until this many messages have arrived (other than pings, heartbeats and questions for
  /// capabilities), and returns them; fewer after 20 s.
  std::vector<Received> waitReceived(std::size_t count);
  /// The same for vertices, which are stored separately.
  std::vector<wire::SetVertex> waitVertices(std::size_t count);
  std::size_t connections() const { return connections_; }
  std::size_t pings() const { return pings_; }
  std::size_t heartbeats() const { return heartbeats_; }

 private:
  struct Session {
    net::Connection connection;
    std::optional<wire::Peer> peer;
    std::unique_ptr<net::UdpSocket> udp;
    std::optional<net::Endpoint> udpPeer;
  };

  void run(std::function<void()> function);
  void serve(net::Connection connection, bool withDatagrams);
  void onEvent(Session& session, const wire::Event& event, bool byDatagram);
  bool answer(Session& session, const wire::MessageReceived& message);
  void push(Session& session);
  void openPort();

  ScriptedServerOptions options_;
  net::Loop loop_;
  wire::LocalNames names_;
  wire::LocalSender device_;
  std::unique_ptr<net::TcpListener> listener_;
  std::unique_ptr<net::UdpSocket> requests_;
  std::list<Session> sessions_;
  std::uint16_t port_ = 0;
  std::atomic<std::size_t> connections_{0};
  std::atomic<std::size_t> pings_{0};
  std::atomic<std::size_t> heartbeats_{0};
  std::atomic<bool> ignorePings_{false};

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Received> received_;
  std::vector<wire::SetVertex> vertices_;
  std::thread thread_;
};

}  // namespace hapticd::test
