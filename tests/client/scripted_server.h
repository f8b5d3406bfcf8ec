// A small VRPN server for tests of clients: real sockets on 127.0.0.1, a thread of its own, and a memory of
// everything it was told. It answers pings of its device and says what a test makes it say.
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
  bool answers_pings = true;
  bool reads = true;                                 ///< false: accepts and shakes hands, then never reads
  std::optional<wire::Capabilities> capabilities{};  ///< answered, if set, to who asks for them
  std::string greeting_bytes{};                      ///< sent instead of everything VRPN, if not empty
};

/// What a server of this project answers, of version 1.
wire::Capabilities allCapabilities();

/// A message as it arrived.
struct Told {
  wire::Message message;
  std::string sender;
  wire::Time time;
  bool by_datagram = false;
};

class ScriptedServer {
 public:
  explicit ScriptedServer(ScriptedServerOptions options = {});
  ~ScriptedServer();

  std::uint16_t port() const { return port_; }
  /// "Phantom@127.0.0.1:PORT" and "Phantom@tcp://127.0.0.1:PORT".
  std::string name() const { return options_.device + "@127.0.0.1:" + std::to_string(port_); }
  std::string tcpName() const { return options_.device + "@tcp://127.0.0.1:" + std::to_string(port_); }

  /// Sends a message of the device (or of another one) to all clients; by datagram where that is agreed.
  template <class M>
  void say(const M& message, wire::Time time = {1700000000, 250000}, const std::string& sender = {}) {
    run([this, message, time, sender] {
      const wire::LocalSender id = sender.empty() ? device_ : names_.addSender(sender);
      for (Session& session : sessions_) {
        if (session.endpoint) session.endpoint->send(time, id, message);
        push(session);
      }
    });
  }
  /// Sends a message of the device of a type that is not in the table.
  void sayOther(const std::string& type, const std::string& payload);
  /// Sends bytes that need not be VRPN.
  void sayRaw(const std::string& bytes);
  /// Closes all connections, as a server does that is stopped.
  void dropClients();
  /// Goes on reading.
  void startReading();

  /// Waits until as many messages as given came (other than pings, heartbeats and questions for
  /// capabilities), and returns them; fewer after 20 s.
  std::vector<Told> waitTold(std::size_t count);
  /// The same for vertices, which are kept apart.
  std::vector<wire::SetVertex> waitVertices(std::size_t count);
  std::size_t connections() const { return connections_; }
  std::size_t pings() const { return pings_; }
  std::size_t heartbeats() const { return heartbeats_; }

 private:
  struct Session {
    net::Connection connection;
    std::optional<wire::Peer> endpoint;
    std::unique_ptr<net::UdpSocket> udp;
    std::optional<net::Endpoint> udp_peer;
  };

  void run(std::function<void()> function);
  void serve(net::Connection connection, bool with_datagrams);
  void onEvent(Session& session, const wire::Event& event, bool by_datagram);
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

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Told> told_;
  std::vector<wire::SetVertex> vertices_;
  std::thread thread_;
};

}  // namespace hapticd::test
