// How a link comes up and goes down.
#include "client/link.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "hapticd/error.h"
#include "wire/text.h"

namespace hapticd::client {
namespace {

using namespace std::chrono_literals;
using SteadyClock = std::chrono::steady_clock;

constexpr auto kHandshakeTimeout = 3s;

net::ConnectionOptions connectionOptions(const LinkOptions& options) {
  net::ConnectionOptions result;
  result.hardLimitBytes = SIZE_MAX;  // the link keeps the queue short itself, by waiting
  result.lossTimeout = options.send_timeout;
  result.keepAlive = 5s;
  return result;
}

}  // namespace

wire::Time wireNow() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(now).count();
  return {static_cast<std::uint32_t>(us / 1000000), static_cast<std::uint32_t>(us % 1000000)};
}

std::chrono::system_clock::time_point toTimePoint(wire::Time time) {
  return std::chrono::system_clock::time_point(std::chrono::seconds(time.seconds) +
                                               std::chrono::microseconds(time.microseconds));
}

Link::Link(const ServerAddress& server, const LinkOptions& options) : server_(server), options_(options) {
  try {
    address_ = {net::resolve(server_.host), server_.port};
  } catch (const net::Error& error) {
    throw ConnectError("no server at " + server_.text() + ": " + error.what());
  }
  loop_.setErrorHandler([this](std::string_view text) { last_failure_ = text; });
  attempt();
}

wire::LocalSender Link::addDevice(std::string_view name) {
  const wire::LocalSender sender = names_.addSender(name);
  if (std::find(devices_.begin(), devices_.end(), sender) == devices_.end()) {
    devices_.push_back(sender);
    heard_.resize(names_.senders().size());
    if (connected()) endpoint_->send(wireNow(), sender, wire::Ping{});
  }
  return sender;
}

// --- connecting

void Link::attempt() {
  retry_.cancel();
  try {
    if (server_.tcp_only) {
      adopt(net::Connection::connect(loop_, address_, kHandshakeTimeout, connectionOptions(options_)));
    } else {
      call_back_.emplace(
          loop_, address_, connectionOptions(options_),
          [this](net::Connection connection) {
            call_back_.reset();
            adopt(std::move(connection));
          },
          [this] { last_failure_ = "UDP request: " + std::string(std::strerror(ECONNREFUSED)); });
    }
  } catch (const net::Error& error) {
    last_failure_ = error.what();
    retryLater();
  }
}

void Link::retryLater() {
  if (connections_ == 0 || options_.reconnect) {
    retry_ = loop_.after(options_.retry_interval, [this] { attempt(); });
  }
}

void Link::adopt(net::Connection connection) {
  wire::PeerOptions options;
  if (!server_.tcp_only) options.udp = openDatagrams({connection.local().address, 0});
  endpoint_.emplace(names_, options);
  connection_ = std::move(connection);
  connection_.start({.onConnected = {},
                     .onBytes = [this](auto bytes) { received(bytes); },
                     .onDrained = {},
                     .onClosed = [this](const std::string& reason) { onClosed(reason); }});
  handshake_timeout_ = loop_.after(kHandshakeTimeout, [this] {
    connection_.abort("it accepts connections, but does not answer as a VRPN server does");
  });
  stream_bytes_ = 0;
  pushOut();
}

// Without a socket for datagrams everything goes by TCP.
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
  handshake_timeout_.cancel();
  ++connections_;
  if (onUp) onUp();
  endpoint_->sendFrames(wireNow(), backlog_.bytes(), wire::Reliability::kReliable);
  backlog_.clear();
  heard_.assign(names_.senders().size(), false);
  inbox_.push({.what = Arrival::What::connected, .arrived = std::chrono::system_clock::now()});
  pingUnheard();
  ping_ = loop_.every(1s, [this] { pingUnheard(); });
}

void Link::pingUnheard() {
  bool all = true;
  for (const wire::LocalSender device : devices_) {
    if (heard_[static_cast<std::size_t>(device.value)]) continue;
    all = false;
    endpoint_->send(wireNow(), device, wire::Ping{});
  }
  if (all) ping_.cancel();
  pushOut();
}

void Link::onClosed(const std::string& reason) {
  const bool was_connected = shaken();
  last_failure_ = reason;
  addTraffic(statistics_);
  if (was_connected) {
    inbox_.push({.what = Arrival::What::lost,
                 .arrived = std::chrono::system_clock::now(),
                 .bytes = wire::asBytes(reason)});
  }
  ping_.cancel();
  handshake_timeout_.cancel();
  endpoint_.reset();
  udp_.reset();
  udp_peer_.reset();
  server_devices_.clear();
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
  const auto deadline = SteadyClock::now() + std::min(timeout, kLongestWait);
  while (!condition()) {
    const Duration left = deadline - SteadyClock::now();
    if (left <= Duration::zero()) return false;
    loop_.runOnce(left);
  }
  return true;
}

std::string Link::whyNotConnected() const {
  if (last_failure_.find(std::strerror(ECONNREFUSED)) != std::string::npos) {
    return "nothing listens on " + server_.text() + " (" + last_failure_ +
           "): start `hapticd serve` there, or correct host and port";
  }
  if (last_failure_.empty() && !server_.tcp_only) {
    return "no server at " + server_.text() +
           " answers the UDP request: start `hapticd serve` there, correct host and port, or, if a firewall "
           "blocks "
           "the server's call back, connect to NAME@tcp://" +
           server_.text();
  }
  return "no VRPN server at " + server_.text() + ": " + (last_failure_.empty() ? "no answer" : last_failure_);
}

std::vector<std::string> Link::serverDevices() const {
  return server_devices_;
}

}  // namespace hapticd::client
