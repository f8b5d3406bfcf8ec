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

// Big enough that one system call carries over a thousand vertices, small enough to stay in the cache.
constexpr std::size_t kBatchBytes = 64 * 1024;
// Reports that may wait while a command waits for the server; then the server has to wait too.
constexpr std::size_t kMostWaitingBytes = 64 * 1024 * 1024;
constexpr auto kHandshakeTimeout = 3s;
constexpr Duration kLongestWait = 24h;

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
  wire::EndpointOptions options;
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

template <class Condition>
bool Link::waitUntil(Condition&& condition, Duration timeout) {
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

// --- receiving

void Link::received(wire::ByteView bytes) {
  endpoint_->feed(wireNow(), bytes, [this](const wire::Event& event) { onEvent(event); });
  pushOut();
}

// The peer of the TCP connection is the only one whose datagrams count.
void Link::receivedDatagram(wire::ByteView bytes, const net::Endpoint& from) {
  const bool known =
      from.address == connection_.remote().address || (udp_peer_ && from.address == udp_peer_->address);
  if (!known || inbox_.waitingBytes() > kMostWaitingBytes) return;
  endpoint_->feedDatagram(bytes, [this](const wire::Event& event) { onEvent(event); });
}

void Link::onEvent(const wire::Event& event) {
  if (const auto* message = std::get_if<wire::MessageReceived>(&event)) {
    onMessage(*message);
  } else if (std::holds_alternative<wire::Connected>(event)) {
    onConnected();
  } else if (const auto* sender = std::get_if<wire::SenderDescribed>(&event)) {
    // Stock servers describe our own names back to us; those say nothing about what the server has.
    if (!names_.findSender(sender->name)) server_devices_.emplace_back(sender->name);
    adoptName(sender->name, &wire::LocalNames::addSender);
  } else if (const auto* type = std::get_if<wire::TypeDescribed>(&event)) {
    adoptName(type->name, &wire::LocalNames::addType);
  } else if (const auto* udp = std::get_if<wire::UdpDescribed>(&event)) {
    onUdpDescribed(udp->address);
  } else if (const auto* error = std::get_if<wire::ProtocolError>(&event)) {
    connection_.abort("it broke the VRPN protocol: " + std::string(error->reason));
  }
}

template <class Id>
void Link::adoptName(std::string_view name, Id (wire::LocalNames::*add)(std::string_view)) {
  if (!options_.adopt_names) return;
  try {
    (names_.*add)(name);
  } catch (const std::logic_error&) {
    // A name that we could not describe ourselves, or one too many: its messages stay strangers.
  }
}

void Link::onUdpDescribed(const wire::UdpAddress& address) {
  try {
    udp_peer_ = net::Endpoint::parse(address.host, address.port);
    endpoint_->useDatagrams();
  } catch (const net::Error&) {
    // Not a number: everything goes on by TCP.
  }
}

void Link::onMessage(const wire::MessageReceived& message) {
  ++statistics_.messages_in;
  wire::LocalSender sender = message.local_sender;
  if (sender.value < 0) sender = names_.findSender(message.sender_name).value_or(wire::LocalSender{});
  if (sender.value >= 0) {
    if (heard_.size() < names_.senders().size()) heard_.resize(names_.senders().size());
    heard_[static_cast<std::size_t>(sender.value)] = true;
  }
  wire::LocalType type;
  if (message.kind != wire::kUnknownKind) {
    type = wire::localType(message.kind);
  } else {
    const auto& types = names_.types();
    const auto known = std::find(types.begin(), types.end(), message.type_name);
    if (known != types.end()) type.value = static_cast<std::int32_t>(known - types.begin());
  }
  inbox_.push({.what = Arrival::What::message,
               .kind = message.kind,
               .sender = sender,
               .type = type,
               .time = message.time,
               .arrived = std::chrono::system_clock::now(),
               .bytes = message.payload});
  if (inbox_.waitingBytes() > kMostWaitingBytes && !paused_) {
    paused_ = true;
    connection_.pauseReading();
  }
}

std::size_t Link::dispatch(const Handler& handler) {
  if (dispatching_) return 0;
  struct Scope {
    bool& flag;
    explicit Scope(bool& f) : flag(f) { flag = true; }
    ~Scope() { flag = false; }
  } scope(dispatching_);
  std::size_t count = 0;
  for (Arrival arrival; inbox_.pop(arrival); ++count) handler(arrival);
  if (paused_) {
    paused_ = false;
    connection_.resumeReading();
  }
  return count;
}

std::size_t Link::poll(Duration timeout, const Handler& handler) {
  flush();
  std::size_t count = dispatch(handler);
  const auto deadline = SteadyClock::now() + std::min(timeout, kLongestWait);
  do {
    const Duration left = count > 0 ? Duration::zero() : Duration(deadline - SteadyClock::now());
    loop_.runOnce(std::max(left, Duration::zero()));
    count += dispatch(handler);
  } while (count == 0 && SteadyClock::now() < deadline);
  flush();
  return count;
}

// --- sending

void Link::sendRaw(wire::Time time, wire::LocalSender sender, wire::LocalType type, wire::ByteView payload,
                   wire::Reliability reliability) {
  if (connected()) {
    endpoint_->sendRaw(time, sender, type, payload, reliability);
  } else if (connections_ == 0) {
    backlog_.addRaw(time, sender.value, type.value, payload);
  } else {
    ++statistics_.messages_dropped;
    return;
  }
  sent(wire::kHeaderBytes + wire::padded(payload.size()));
}

void Link::sent(std::size_t bytes) {
  ++statistics_.messages_out;
  uncounted_ += bytes;
  if (uncounted_ < kBatchBytes) return;
  flush();
  if (!connected()) {
    if (backlog_.bytes().size() > options_.queue_limit) {
      throw ConnectError(whyNotConnected() + "; " + std::to_string(backlog_.bytes().size()) +
                         " bytes wait to be sent");
    }
    uncounted_ = 0;
  } else if (connection_.statistics().queuedBytes > options_.queue_limit) {
    drainTo(options_.queue_limit / 2);
  } else if (onDrainStep) {
    onDrainStep();
  }
}

void Link::flush() {
  if (connected()) {
    endpoint_->announce(wireNow());
    pushOut();
  }
}

void Link::pushOut() {
  if (!endpoint_) return;
  const auto buffer = takeBuffer();
  endpoint_->takeStream(*buffer);
  if (!buffer->empty()) {
    stream_bytes_ += buffer->size();
    connection_.send(buffer);
    connection_.flush();
  }
  endpoint_->takeDatagrams([this](wire::ByteView datagram) { udp_->sendTo(datagram, *udp_peer_); });
  uncounted_ = 0;
}

// A buffer that nobody sends any more keeps its memory for the next batch.
std::shared_ptr<net::Buffer> Link::takeBuffer() {
  const auto unused =
      std::find_if(buffers_.begin(), buffers_.end(), [](const auto& b) { return b.use_count() == 1; });
  if (unused != buffers_.end()) return *unused;
  buffers_.push_back(std::make_shared<net::Buffer>());
  return buffers_.back();
}

std::uint64_t Link::streamBytesTaken() const {
  return connection_ ? connection_.statistics().bytesOut : 0;
}

void Link::drainTo(std::size_t bytes) {
  flush();
  const std::uint64_t number = connections_;
  std::uint64_t taken = streamBytesTaken();
  auto progress_at = SteadyClock::now();
  while (connected() && connections_ == number && connection_.statistics().queuedBytes > bytes) {
    loop_.runOnce(100ms);
    if (!connected() || connections_ != number) break;
    if (streamBytesTaken() != taken) {
      taken = streamBytesTaken();
      progress_at = SteadyClock::now();
      if (onDrainStep) onDrainStep();
    } else if (SteadyClock::now() - progress_at > options_.send_timeout) {
      const std::string why = server_.text() +
                              " takes no data: " + std::to_string(connection_.statistics().queuedBytes) +
                              " bytes wait since " + std::to_string(options_.send_timeout.count()) + " ms";
      connection_.abort(why);
      throw ConnectionLost(why);
    }
  }
  if (!connected() || connections_ != number) {
    throw ConnectionLost("connection to " + server_.text() + " lost while sending: " + last_failure_);
  }
}

// --- statistics

void Link::addTraffic(LinkStatistics& statistics) const {
  if (connection_) {
    const net::ConnectionStatistics tcp = connection_.statistics();
    statistics.tcp_bytes_in += tcp.bytesIn;
    statistics.tcp_bytes_out += tcp.bytesOut;
  }
  if (udp_) {
    statistics.udp_bytes_in += udp_->statistics().bytesIn;
    statistics.udp_bytes_out += udp_->statistics().bytesOut;
  }
}

LinkStatistics Link::statistics() const {
  LinkStatistics result = statistics_;
  result.connections = connections_;
  addTraffic(result);
  return result;
}

}  // namespace hapticd::client
