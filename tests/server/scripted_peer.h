// A VRPN client made of the wire and net rooms only: sends what a test scripts and keeps what it receives.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "net/connection.h"
#include "net/loop.h"
#include "net/tcp_listener.h"
#include "net/udp_socket.h"
#include "wire/peer.h"
#include "wire/udp_request.h"

namespace hapticd::test {

using namespace std::chrono_literals;

inline constexpr wire::F64x16 kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
/// 1 N upwards, wherever the hand is.
inline const wire::ForceField kUp{.origin = {0, 0, 0}, .force = {0, 1, 0}, .jacobian = {}, .radius = 10};

/// One connection to a server under test. Every wait has a limit.
class ScriptedPeer {
 public:
  enum class Mode { tcp, udp };
  /// Whether the peer performs the handshake of the protocol, or sends only the given bytes.
  enum class Speech { proper, raw };

  explicit ScriptedPeer(const net::Endpoint& server, const std::string& device = "Phantom",
                        Mode mode = Mode::tcp, Speech speech = Speech::proper)
      : speech_(speech), sender_(names_.addSender("VRPN Control")), device_(names_.addSender(device)) {
    if (mode == Mode::tcp) {
      endpoint_ = std::make_unique<wire::Peer>(names_);
      // A large queue, so that a test can send more than the server reads.
      net::ConnectionOptions options;
      options.hardLimitBytes = std::size_t{256} << 20;
      take(net::Connection::connect(loop_, server, 2s, options));
    } else {
      connectBack(server);
    }
  }

  /// Handles events until the condition holds; returns false after the limit.
  bool until(const std::function<bool()>& condition, std::chrono::seconds limit = 60s) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      loop_.runOnce(20ms);
    }
    return true;
  }
  bool untilCalledBack() {
    return until([this] { return static_cast<bool>(connection_); });
  }
  bool untilConnected() {
    return until([this] { return endpoint_ && endpoint_->connected(); });
  }
  /// Waits for the next message of a kind.
  template <wire::WireMessage M>
  bool untilNext() {
    const std::size_t before = count<M>();
    return until([&] { return count<M>() > before; });
  }
  /// Waits for a text that contains this one.
  bool untilText(const std::string& part) {
    return until([&] {
      for (const wire::Text& text : texts_) {
        if (text.text.text.find(part) != std::string::npos) return true;
      }
      return false;
    });
  }
  bool untilClosed() {
    return until([this] { return closed_; });
  }

  template <wire::WireMessage M>
  void send(const M& message) {
    queue(message);
    flush();
  }
  /// Queues a message; the next flush() or send() sends it.
  template <wire::WireMessage M>
  void queue(const M& message) {
    endpoint_->send({1, 2}, device_, message);
  }
  /// Sends a message with any payload, valid or not.
  void sendPayload(wire::MessageKind kind, const std::vector<std::byte>& payload) {
    endpoint_->sendRaw({1, 2}, device_, wire::localType(kind), payload, wire::Reliability::kReliable);
    flush();
  }
  /// Sends a message of a type that is not in the message table.
  void sendForeign(const std::string& type, const std::vector<std::byte>& payload) {
    endpoint_->sendRaw({1, 2}, device_, names_.addType(type), payload, wire::Reliability::kReliable);
    flush();
  }
  /// Sends raw bytes.
  void sendBytes(wire::ByteView bytes) {
    connection_.send(bytes);
    connection_.flush();
  }
  /// Sends raw bytes as one datagram to the server's UDP endpoint.
  void sendDatagram(wire::ByteView bytes) { udp_->sendTo(bytes, udpPeer_); }
  void flush() {
    std::vector<std::byte> bytes;
    endpoint_->takeStream(bytes);
    if (speech_ == Speech::raw) return;
    if (!bytes.empty()) connection_.send(std::span<const std::byte>(bytes));
    connection_.flush();
    if (udp_) endpoint_->takeDatagrams([this](wire::ByteView datagram) { udp_->sendTo(datagram, udpPeer_); });
  }
  void close() { connection_.abort("test over"); }
  /// Sends what is queued, then closes the connection.
  void end() { connection_.close("test over"); }
  /// Whether the server's machine has received everything that was sent.
  bool delivered() const {
    const net::ConnectionStatistics statistics = connection_.statistics();
    return statistics.queuedBytes == 0 && statistics.unacknowledgedBytes == 0;
  }
  /// Handles pending events without waiting.
  void poll() {
    while (loop_.runOnce(std::chrono::milliseconds(0)) > 0) {
    }
  }

  /// All messages of a kind received so far from the device.
  template <wire::WireMessage M>
  std::vector<M> all() const {
    std::vector<M> found;
    for (const std::size_t place : placesOf(wire::kindOf<M>)) {
      const auto decoded = wire::decode<M>(messages_[place].payload);
      if (decoded) found.push_back(*decoded);
    }
    return found;
  }
  template <wire::WireMessage M>
  std::size_t count() const {
    return count(wire::kindOf<M>);
  }
  std::size_t count(wire::MessageKind kind) const { return placesOf(kind).size(); }
  /// All texts received so far from any sender.
  const std::vector<wire::Text>& texts() const { return texts_; }
  /// The newest message of a kind, or the newest that matches.
  template <wire::WireMessage M>
  std::optional<M> last() const {
    return last<M>([](const M&) { return true; });
  }
  template <wire::WireMessage M, class Fits>
  std::optional<M> last(const Fits& fits) const {
    const std::vector<std::size_t>& places = placesOf(wire::kindOf<M>);
    for (auto place = places.rbegin(); place != places.rend(); ++place) {
      const auto decoded = wire::decode<M>(messages_[*place].payload);
      if (decoded && fits(*decoded)) return *decoded;
    }
    return std::nullopt;
  }
  void forget() {
    messages_.clear();
    places_.clear();
    texts_.clear();
  }

  bool open() const { return !closed_; }
  const std::string& closeReason() const { return reason_; }
  std::size_t datagrams() const { return datagrams_; }
  /// The peer's UDP port, and the server's UDP endpoint.
  std::uint16_t udpPort() const { return udp_->local().port; }
  const net::Endpoint& udpPeer() const { return udpPeer_; }
  net::Connection& connection() { return connection_; }
  wire::Peer& endpoint() { return *endpoint_; }
  wire::LocalSender device() const { return device_; }

  struct Received {
    wire::MessageKind kind;
    wire::Time time;
    std::vector<std::byte> payload;
    bool byDatagram;
  };
  const std::vector<Received>& messages() const { return messages_; }

 private:
  const std::vector<std::size_t>& placesOf(wire::MessageKind kind) const {
    static const std::vector<std::size_t> kNone;
    const auto entry = places_.find(kind);
    return entry == places_.end() ? kNone : entry->second;
  }

  void take(net::Connection connection) {
    connection_ = std::move(connection);
    connection_.start(
        {.onConnected = {},
         .onBytes =
             [this](auto bytes) {
               endpoint_->feed({1, 2}, bytes, [this](const wire::Event& e) { onEvent(e, false); });
               flush();
             },
         .onDrained = {},
         .onClosed =
             [this](const std::string& reason) {
               closed_ = true;
               reason_ = reason;
             }});
    flush();
  }

  void connectBack(const net::Endpoint& server) {
    listener_ = std::make_unique<net::TcpListener>(
        loop_, net::Endpoint{net::kLoopbackAddress, 0},
        [this](net::Connection connection) { take(std::move(connection)); });
    udp_ = std::make_unique<net::UdpSocket>(loop_, net::Endpoint{net::kLoopbackAddress, 0});
    udp_->start({.onDatagram =
                     [this](auto bytes, const auto&) {
                       ++datagrams_;
                       endpoint_->feedDatagram(bytes, [this](const wire::Event& e) { onEvent(e, true); });
                     },
                 .onRefused = {}});
    wire::PeerOptions options;
    options.udp = wire::UdpAddress{"127.0.0.1", udp_->local().port};
    endpoint_ = std::make_unique<wire::Peer>(names_, options);
    const std::string request = wire::formatUdpRequest({"127.0.0.1", listener_->local().port});
    udp_->sendTo(std::as_bytes(std::span(request)), server);
  }

  void onEvent(const wire::Event& event, bool byDatagram) {
    if (const auto* message = std::get_if<wire::MessageReceived>(&event)) {
      if (message->kind == wire::kindOf<wire::Text>) {
        texts_.push_back(*wire::decode<wire::Text>(message->payload));
      }
      const bool listensToAll = device_ == sender_;  // uses no device
      if (!listensToAll && message->local_sender != device_) return;
      places_[message->kind].push_back(messages_.size());
      messages_.push_back(
          {message->kind, message->time, {message->payload.begin(), message->payload.end()}, byDatagram});
    } else if (const auto* described = std::get_if<wire::UdpDescribed>(&event)) {
      udpPeer_ = net::Endpoint::parse(described->address.host, described->address.port);
      endpoint_->useDatagrams();
    }
  }

  const Speech speech_;
  net::Loop loop_;
  wire::LocalNames names_;
  wire::LocalSender sender_;
  wire::LocalSender device_;
  std::unique_ptr<wire::Peer> endpoint_;
  std::unique_ptr<net::TcpListener> listener_;
  std::unique_ptr<net::UdpSocket> udp_;
  net::Endpoint udpPeer_;
  net::Connection connection_;
  std::vector<Received> messages_;
  // In messages_. Conditions are asked after each message: with a search through all of them, a peer under a
  // sanitizer would fall behind a server that reports at 1 kHz, and never catch up.
  std::map<wire::MessageKind, std::vector<std::size_t>> places_;
  std::vector<wire::Text> texts_;
  std::size_t datagrams_ = 0;
  bool closed_ = false;
  std::string reason_;
};

}  // namespace hapticd::test
