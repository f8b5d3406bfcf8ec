// The other side of a Link: serves the devices of a program to VRPN clients.
#pragma once

#include <list>
#include <memory>
#include <optional>
#include <string>

#include "client/link.h"
#include "net/tcp_listener.h"
#include "net/udp_socket.h"

namespace hapticd::client {

/// Accepts clients in both of VRPN's ways to connect, sends every message to all of them and queues what they
/// send. Thread: that of the caller, always the same one.
class ServerLink {
 public:
  /// Without an address nobody can connect: for devices that are used inside one program. Throws net::Error
  /// when the port is taken. Port 0 lets the system choose one.
  explicit ServerLink(const std::optional<net::Endpoint>& local);
  ServerLink(const ServerLink&) = delete;
  ServerLink& operator=(const ServerLink&) = delete;

  wire::LocalSender addSender(std::string_view name) { return names_.addSender(name); }
  wire::LocalType addType(std::string_view name) { return names_.addType(name); }
  const wire::LocalNames& names() const noexcept { return names_; }

  /// Collects a message for all clients that are connected now.
  void send(wire::Time time, wire::LocalSender sender, wire::LocalType type, wire::ByteView payload,
            wire::Reliability reliability);
  /// Gives what is collected to the system. A client that does not read for long is disconnected.
  void flush();
  /// As Link::poll().
  std::size_t poll(Duration timeout, const Link::Handler& handler);

  /// 0 without an address.
  std::uint16_t port() const noexcept;

 private:
  struct Client {
    net::Connection connection;
    std::optional<net::UdpSocket> udp;
    std::optional<net::Endpoint> udpPeer;
    std::optional<wire::Peer> peer;
    std::size_t adopted = 0;  // names that only it has described so far
    bool announced = false;   // to the handler of poll()
  };

  void listen(const net::Endpoint& local);
  void onRequest(wire::ByteView bytes, const net::Endpoint& from);
  void add(net::Connection connection, bool datagrams);
  void onEvent(Client& client, const wire::Event& event);
  void onUdpDescribed(Client& client, const wire::UdpAddress& address);
  void onClosed(Client& client, const std::string& reason);
  void adoptSender(Client& client, std::string_view name);
  void adoptType(Client& client, std::string_view name);
  bool mayAdopt(Client& client);
  void flush(Client& client);

  net::Loop loop_;
  wire::LocalNames names_;
  Inbox inbox_;
  std::optional<net::TcpListener> listener_;
  std::optional<net::UdpSocket> requests_;
  std::list<Client> clients_;
  std::list<net::Connection> calling_;  // reverse connections that are not established yet
  std::size_t adopted_ = 0;             // names that the program did not name itself
  std::size_t uncounted_ = 0;           // bytes collected since the last flush()
  bool dispatching_ = false;
};

}  // namespace hapticd::client
