// What goes over a link: receiving, dispatching, sending.
#include <algorithm>

#include "client/link.h"
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

}  // namespace

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
  if (onArriving) onArriving(message.kind, sender, message.payload);
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

void Link::dropHeld() {
  holding_ = false;
  held_ = {};  // its memory, too: a batch may be a large mesh
}

void Link::sendHeld(wire::LocalSender device) {
  wire::FrameEncoder frames;
  std::swap(frames, held_);
  holding_ = false;
  const std::size_t size = frames.bytes().size();
  if (size > kMostBatchBytes) {
    throw std::length_error("a batch of " + std::to_string(size) + " bytes, at most " +
                            std::to_string(kMostBatchBytes) + ": send it in several");
  }
  const wire::Time now = wireNow();
  endpoint_->send(now, device, wire::BatchBegin{});
  endpoint_->sendFrames(now, frames.bytes(), wire::Reliability::kReliable);
  endpoint_->send(now, device, wire::BatchCommit{});
  ++statistics_.messages_out;
  sent(std::max(size, kBatchBytes));
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
