// A client of the simulated server: its machine is not part of the test, so what it does takes no time.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "net/connection.h"
#include "net/loop.h"
#include "net/tcp_listener.h"
#include "net/udp_socket.h"
#include "sim/scheduler.h"
#include "sim/web_stream.h"
#include "wire/messages.h"
#include "wire/peer.h"

namespace hapticd::sim {

/// What all clients share.
struct Clients {
  /// Proves every client an owner, so that each may take back the stops of the others.
  static constexpr std::string_view kToken = "0123456789abcdef";

  net::Loop& loop;
  SimClock& clock;
  net::Endpoint server;
  net::Endpoint web;
  std::string socket{};
  std::function<void(const std::string&)> finding;
  std::function<void(Nanos)> stopRead;   ///< the server has read the last byte of a stop
  std::function<void(Nanos)> rearmRead;  ///< the same of a re-arm
  std::function<Nanos()> netStalled;
  std::function<bool()> shortOfDescriptors;  ///< the server is, or was a moment ago
  std::function<void(const std::string& name, const std::string& text)> heard;  ///< a text of the server
  std::uint64_t stops = 0;
  Nanos slowestStop = 0;  ///< from arrival to reading, without stalls of the machine
};

class SimClient {
 public:
  SimClient(Clients& all, std::string name);
  virtual ~SimClient() = default;
  SimClient(const SimClient&) = delete;
  SimClient& operator=(const SimClient&) = delete;

  void connect();
  /// A reset; the server learns of it after the delay of the network.
  void reset();
  /// The server has greeted it.
  bool connected() const { return peer_ && peer_->connected() && !closed_; }
  bool open() const { return connection_ && !closed_; }
  /// It is connected, or still tries.
  bool present() const { return !closed_; }
  /// Its connection may end: it is hostile, or it went away.
  void expectEnd() { mayEnd_ = true; }
  const std::string& name() const { return name_; }
  /// When it began to connect.
  Nanos asked() const { return asked_; }
  net::Endpoint local() const { return listener_ ? listener_->local() : connection_.local(); }

  template <wire::WireMessage M>
  void queue(const M& message) {
    peer_->send(wallTime(), device_, message);
  }
  void queue(const wire::Message& message) { peer_->send(wallTime(), device_, message); }
  template <wire::WireMessage M>
  void send(const M& message) {
    queue(message);
    flush();
  }
  void sendBytes(std::span<const std::byte> bytes);
  void stopForces();
  void rearmForces();
  void flush();
  void pauseReading() { connection_.pauseReading(); }
  void resumeReading() {
    disagreesSince_.reset();
    connection_.resumeReading();
  }

  // The network, on the server's side.
  void onArrived(std::uint64_t total);
  void onRead(std::uint64_t total);
  std::uint64_t unread() const { return sent_ - read_; }

  /// How often a client with datagrams asks to be connected.
  Nanos askPeriod = 1'000 * kMs;
  /// Sends the token of owners.
  bool identifies = true;
  /// May send more than the server reads ahead: then TCP keeps its stops waiting.
  bool sendsAhead = false;
  enum class Way {
    tcp,        ///< it connects to the server
    datagrams,  ///< as a stock client: the server connects to it, and some messages are datagrams
    web,        ///< as a page: a WebSocket of the web port
    local,      ///< by the Unix socket, which names its user, who needs no token
  };
  Way way = Way::tcp;
  wire::GuardState guard{};  ///< as last reported
  std::uint64_t guardReports = 0;
  std::uint64_t tickReports = 0;
  std::uint64_t lastTick = 0;
  std::uint64_t lastRevision = 0;  ///< of the scene that it felt
  std::uint64_t missedTicks = 0;
  std::vector<std::uint32_t> buttons{0, 0};  ///< as last reported
  std::uint64_t buttonReports = 0;
  std::vector<std::string> texts;
  std::function<void()> onTouched;  ///< it learned of another object that the hand touches

 protected:
  virtual void onConnected() {}
  virtual void onText(const std::string&) {}
  Clients& all_;

 private:
  struct Order {
    std::uint64_t end;  // offset of its last byte in the stream
    bool stop;
    std::optional<Nanos> arrived;
    Nanos stalled = 0;  // of the net thread, then
  };

  wire::Time wallTime() const;
  void askToConnect();
  void adopt(net::Connection connection);
  void sendRaw(std::span<const std::byte> bytes);
  void receive(std::span<const std::byte> bytes);
  void onEvent(const wire::Event& event);
  void onMessage(const wire::MessageReceived& message);
  void compare(const wire::TickReport& tick);

  const std::string name_;
  wire::LocalNames names_;
  wire::PeerOptions options_;
  wire::LocalSender device_;
  std::optional<wire::Peer> peer_;
  std::optional<net::TcpListener> listener_;
  std::optional<net::UdpSocket> udp_;
  std::optional<net::Endpoint> udpPeer_;
  net::Subscription asking_;
  net::Connection connection_;
  WebStream web_;
  std::deque<Order> orders_;
  std::uint64_t sent_ = 0;
  std::uint64_t read_ = 0;  // by the server
  Nanos asked_ = 0;
  bool closed_ = true;
  bool mayEnd_ = false;
  // As the reports of changes say.
  std::optional<std::int32_t> touched_;
  double depth_ = 0;
  std::optional<Nanos> disagreesSince_;  // with the reports of ticks
};

}  // namespace hapticd::sim
