// Connecting, and losing a connection.
#include "client/link.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/world.h"
#include "hapticd/error.h"
#include "net/local_socket.h"
#include "wire/text.h"

namespace hapticd::client {
namespace {

using namespace std::chrono_literals;

constexpr auto kHandshakeTimeout = 3s;

net::ConnectionOptions connectionOptions(const LinkOptions& options) {
  net::ConnectionOptions result;
  result.hardLimitBytes = SIZE_MAX;  // the link bounds the queue itself, by waiting
  result.lossTimeout = options.sendTimeout;
  result.keepAlive = 5s;
  result.closeTimeout = 24h;  // the destructor bounds it
  return result;
}

}  // namespace

wire::Time wireNow() {
  const base::Nanos us = base::wallNow() / 1000;
  return {static_cast<std::uint32_t>(us / 1000000), static_cast<std::uint32_t>(us % 1000000)};
}

std::chrono::system_clock::time_point toTimePoint(wire::Time time) {
  return std::chrono::system_clock::time_point(std::chrono::seconds(time.seconds) +
                                               std::chrono::microseconds(time.microseconds));
}

std::chrono::system_clock::time_point wallTimePoint() {
  return std::chrono::system_clock::time_point(std::chrono::nanoseconds(base::wallNow()));
}

Link::Link(const ServerAddress& server, const LinkOptions& options) try
    : process_(::getpid()), server_(server), options_(options) {
  if (server_.socket.empty()) address_ = {host_.emplace(server_.host).address(), server_.port};
  loop_.setErrorHandler([this](std::string_view text) { lastFailure_ = text; });
  attempt();
} catch (const net::Error& error) {  // also of the loop
  throw ConnectError("no server at " + server.text() + ": " + error.what());
}

// The system resets a connection that is closed with unread reports, and drops what it has not sent.
Link::~Link() {
  constexpr Duration kCheck = 50ms;
  if (!connected() || process_ != ::getpid()) return;  // in a forked process, the connection is the parent's
  try {
    flush();
    pingTimer_.cancel();
    udp_.reset();  // onArrival may refer to what is gone
    connection_.close("closed");
    std::size_t left = SIZE_MAX;
    base::Nanos lastProgress = 0;
    while (connection_ && connection_.nativeHandle() >= 0) {
      if (const std::size_t bytes = backlogBytes(); bytes != left) {
        left = bytes;
        lastProgress = base::now();
      }
      if (Duration(base::now() - lastProgress) > (left > 0 ? options_.endSendTimeout : kEndTimeout)) break;
      loop_.runOnce(kCheck);
    }
  } catch (const std::exception&) {  // called by a function of the event loop
  }
}

wire::LocalSender Link::addDevice(std::string_view name) {
  const wire::LocalSender sender = names_.addSender(name);
  if (std::find(devices_.begin(), devices_.end(), sender) == devices_.end()) {
    devices_.push_back(sender);
    heard_.resize(names_.senders().size());
    if (connected()) {
      peer_->send(wireNow(), sender, wire::Ping{});
      pingTimer_ = loop_.every(1s, [this] { pingUnheard(); });
    }
  }
  return sender;
}

// --- connecting

void Link::attempt() {
  retryTimer_.cancel();
  try {
    if (!server_.socket.empty()) {
      adopt(net::connectLocal(loop_, server_.socket, connectionOptions(options_)));
    } else if (server_.tcpOnly) {
      adopt(net::Connection::connect(loop_, address_, kHandshakeTimeout, connectionOptions(options_)));
    } else {
      reverseConnection_.emplace(
          loop_, address_, [this] { return renewedAddress(); }, connectionOptions(options_),
          [this](net::Connection connection) {
            reverseConnection_.reset();
            adopt(std::move(connection));
          },
          [this] { lastFailure_ = "UDP request: " + std::string(std::strerror(ECONNREFUSED)); });
    }
  } catch (const net::Error& error) {
    lastFailure_ = error.what();
    retryLater();
  }
}

void Link::retryLater() {
  if (connections_ == 0 || options_.reconnect) {
    if (host_) host_->askAgain();
    retryTimer_ = loop_.after(options_.retryInterval, [this] {
      if (host_) address_.address = host_->address();
      attempt();
    });
  }
}

const net::Endpoint& Link::renewedAddress() {
  address_.address = host_->address();
  host_->askAgain();
  return address_;
}

void Link::adopt(net::Connection connection) {
  wire::PeerOptions options;
  if (!server_.tcpOnly) options.udp = openDatagrams({connection.local().address, 0});
  peer_.emplace(names_, options);
  connection_ = std::move(connection);
  connection_.start({.onConnected = {},
                     .onBytes = [this](auto bytes) { received(bytes); },
                     .onDrained = {},
                     .onClosed = [this](const std::string& reason) { onClosed(reason); }});
  handshakeTimer_ = loop_.after(kHandshakeTimeout, [this] {
    connection_.abort("it accepts connections, but does not answer as a VRPN server");
  });
  streamBytes_ = 0;
  pushOut();
}

// Without a datagram socket, everything is sent by TCP.
std::optional<wire::UdpAddress> Link::openDatagrams(const net::Endpoint& local) {
  try {
    udp_.emplace(loop_, local);
  } catch (const net::Error&) {
    return std::nullopt;
  }
  udp_->start({.onDatagram = [this](auto bytes, const net::Endpoint& from) { receivedDatagram(bytes, from); },
               .onRefused = {}});
  return wire::UdpAddress{local.addressText(), udp_->local().port};
}

void Link::onConnected() {
  handshakeTimer_.cancel();
  ++connections_;
  if (onUp) onUp();
  peer_->sendFrames(wireNow(), backlog_.bytes(), wire::Reliability::kReliable);
  backlog_.clear();
  heard_.assign(names_.senders().size(), false);
  inbox_.push({.what = Arrival::What::connected, .arrived = wallTimePoint()});
  announced_ = true;
  pingUnheard();
  pingTimer_ = loop_.every(1s, [this] { pingUnheard(); });
}

void Link::pingUnheard() {
  bool all = true;
  for (const wire::LocalSender device : devices_) {
    if (heard_[static_cast<std::size_t>(device.value)]) continue;
    all = false;
    peer_->send(wireNow(), device, wire::Ping{});
  }
  if (all) pingTimer_.cancel();
  pushOut();
}

void Link::onClosed(const std::string& reason) {
  const bool wasConnected = std::exchange(announced_, false);
  lastFailure_ = reason;
  if (!wasConnected && server_.socket.empty() && reason.ends_with("by the peer"))
    lastFailure_ +=
        " before it answered; a server that asks for TLS needs 'hapticd tunnel', and a tunnel prints why it "
        "reaches no server";
  addTraffic(statistics_);
  if (wasConnected) {
    inbox_.push({.what = Arrival::What::lost, .arrived = wallTimePoint(), .bytes = wire::asBytes(reason)});
  }
  pingTimer_.cancel();
  handshakeTimer_.cancel();
  peer_.reset();
  udp_.reset();
  udpPeer_.reset();
  serverDevices_.clear();
  connection_ = {};
  uncounted_ = 0;
  paused_ = false;
  retryLater();
}

bool Link::waitConnected(Duration timeout) {
  return waitUntil([this] { return connected(); }, timeout);
}

bool Link::waitHeard(wire::LocalSender device, Duration timeout) {
  return waitUntil([&] { return heard(device); }, timeout);
}

bool Link::waitUntil(const std::function<bool()>& condition, Duration timeout) {
  flush();
  const base::Nanos deadline = base::now() + std::min<Duration>(timeout, kLongestWait).count();
  while (!condition()) {
    const Duration left(deadline - base::now());
    if (left <= Duration::zero()) return false;
    loop_.runOnce(left);
  }
  return true;
}

void Link::runOnce() {
  flush();
  loop_.runOnce(Duration::zero());
}

std::string Link::whyNotConnected() const {
  const auto failedBy = [&](int error) {
    return lastFailure_.find(std::strerror(error)) != std::string::npos;
  };
  if (!server_.socket.empty() && (failedBy(ENOENT) || failedBy(ECONNREFUSED))) {
    return "nothing listens on " + server_.text() + " (" + lastFailure_ +
           "): start `hapticd serve` with this socket, or correct the path";
  }
  if (failedBy(ECONNREFUSED)) {
    return "nothing listens on " + server_.text() + " (" + lastFailure_ +
           "): start `hapticd serve` there, or correct host and port";
  }
  if (lastFailure_.empty() && !server_.tcpOnly) {
    return "no server at " + server_.text() +
           " answers the UDP request: start `hapticd serve` there, correct host and port, or, if a firewall "
           "blocks the connection from the server, connect to NAME@tcp://" +
           server_.text();
  }
  return "no VRPN server at " + server_.text() + ": " + (lastFailure_.empty() ? "no answer" : lastFailure_);
}

std::vector<std::string> Link::serverDevices() const {
  return serverDevices_;
}

}  // namespace hapticd::client
