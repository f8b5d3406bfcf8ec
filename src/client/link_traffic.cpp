// Receiving, dispatching, sending.
#include <algorithm>

#include "base/world.h"
#include "client/link.h"
#include "hapticd/error.h"
#include "net/socket_options.h"
#include "wire/text.h"

namespace hapticd::client {
namespace {

using namespace std::chrono_literals;

// Large enough for over a thousand vertices per system call, small enough to stay in the cache.
constexpr std::size_t kBatchBytes = 64 * 1024;
// Reports that may wait for dispatch, for example while a command sleeps; beyond it the link stops reading.
constexpr std::size_t kMaxWaitingBytes = 64 * 1024 * 1024;

}  // namespace

// --- receiving

void Link::received(wire::ByteView bytes) {
  peer_->feed(wireNow(), bytes, [this](const wire::Event& event) { onEvent(event); });
  pushOut();
}

// Only datagrams from the peer of the TCP connection count.
void Link::receivedDatagram(wire::ByteView bytes, const net::Endpoint& from) {
  const bool known =
      from.address == connection_.remote().address || (udpPeer_ && from.address == udpPeer_->address);
  if (!known || inbox_.waitingBytes() > kMaxWaitingBytes) return;
  peer_->feedDatagram(bytes, [this](const wire::Event& event) { onEvent(event); });
}

void Link::onEvent(const wire::Event& event) {
  if (const auto* message = std::get_if<wire::MessageReceived>(&event)) {
    onMessage(*message);
  } else if (std::holds_alternative<wire::Connected>(event)) {
    onConnected();
  } else if (const auto* sender = std::get_if<wire::SenderDescribed>(&event)) {
    // Stock servers describe our own names back to us; those are not evidence of a device.
    if (!names_.findSender(sender->name)) serverDevices_.emplace_back(sender->name);
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
  if (!options_.adoptNames) return;
  try {
    (names_.*add)(name);
  } catch (const std::logic_error&) {
    // An invalid name, or one too many: its messages stay unmapped.
  }
}

void Link::onUdpDescribed(const wire::UdpAddress& address) {
  try {
    udpPeer_ = net::Endpoint::parse(address.host, address.port);
    peer_->useDatagrams();
  } catch (const net::Error&) {
    // Not a numeric address: everything is sent by TCP.
  }
}

void Link::onMessage(const wire::MessageReceived& message) {
  ++statistics_.messagesIn;
  wire::LocalSender sender = message.local_sender;
  if (sender.value < 0) sender = names_.findSender(message.senderName).value_or(wire::LocalSender{});
  if (sender.value >= 0) {
    if (heard_.size() < names_.senders().size()) heard_.resize(names_.senders().size());
    heard_[static_cast<std::size_t>(sender.value)] = true;
  }
  if (onArrival) onArrival(message.kind, sender, message.payload);
  wire::LocalType type;
  if (message.kind != wire::kUnknownKind) {
    type = wire::localType(message.kind);
  } else {
    const auto& types = names_.types();
    const auto known = std::find(types.begin(), types.end(), message.typeName);
    if (known != types.end()) type.value = static_cast<std::int32_t>(known - types.begin());
  }
  inbox_.push({.what = Arrival::What::message,
               .kind = message.kind,
               .sender = sender,
               .type = type,
               .time = message.time,
               .arrived = wallTimePoint(),
               .bytes = message.payload});
  if (inbox_.waitingBytes() > kMaxWaitingBytes && !paused_) {
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
  // A poll() in a callback may bring more each time; they wait for the next dispatch, so that this one ends.
  std::size_t count = 0;
  for (std::size_t left = inbox_.waiting(); left > 0; --left, ++count) {
    Arrival arrival;
    inbox_.pop(arrival);
    handler(arrival);
  }
  if (paused_) {
    paused_ = false;
    connection_.resumeReading();
  }
  return count;
}

std::size_t Link::poll(Duration timeout, const Handler& handler) {
  flush();
  std::size_t count = dispatch(handler);
  if (count > 0 && inbox_.waiting() > 0) {  // callbacks polled: the rest waits for the next call
    flush();
    return count;
  }
  const base::Nanos deadline = base::now() + std::min<Duration>(timeout, kLongestWait).count();
  do {
    const Duration left(count > 0 ? 0 : deadline - base::now());
    loop_.runOnce(std::max(left, Duration::zero()));
    count += dispatch(handler);
  } while (count == 0 && base::now() < deadline);
  flush();
  return count;
}

// --- sending

void Link::sendRaw(wire::Time time, wire::LocalSender sender, wire::LocalType type, wire::ByteView payload,
                   wire::Reliability reliability) {
  if (connected()) {
    peer_->sendRaw(time, sender, type, payload, reliability);
  } else if (connections_ == 0) {
    needRoom();
    backlog_.addRaw(time, sender.value, type.value, payload);
  } else {
    ++statistics_.messagesDropped;
    return;
  }
  sent(wire::kHeaderBytes + wire::padded(payload.size()));
}

// Before the first connection: what does not fit is refused, and not sent later.
void Link::needRoom() const {
  if (backlog_.bytes().size() <= options_.queueLimit_bytes) return;
  throw ConnectError(whyNotConnected() + "; " + std::to_string(backlog_.bytes().size()) +
                     " bytes wait to be sent");
}

void Link::sent(std::size_t bytes) {
  ++statistics_.messagesOut;
  uncounted_ += bytes;
  if (uncounted_ < kBatchBytes) return;
  flush();
  if (!connected()) {
    uncounted_ = 0;
  } else if (connection_.statistics().queuedBytes > options_.queueLimit_bytes) {
    drainTo(options_.queueLimit_bytes / 2);
  } else if (onDrainStep) {
    onDrainStep();
  }
}

void Link::dropHeld() {
  holding_ = false;
  held_ = {};  // also frees the memory: a batch may be a large mesh
}

void Link::sendHeld(wire::LocalSender device) {
  wire::FrameEncoder frames;
  std::swap(frames, held_);
  holding_ = false;
  const std::size_t size = frames.bytes().size();
  if (size > kMaxBatchBytes) {
    throw std::length_error("a batch of " + std::to_string(size) + " bytes, at most " +
                            std::to_string(kMaxBatchBytes) + ": send it in several");
  }
  const wire::Time now = wireNow();
  peer_->send(now, device, wire::BatchBegin{});
  peer_->sendFrames(now, frames.bytes(), wire::Reliability::kReliable);
  peer_->send(now, device, wire::BatchCommit{});
  ++statistics_.messagesOut;
  sent(std::max(size, kBatchBytes));
}

void Link::flush() {
  if (connected()) {
    peer_->announce(wireNow());
    pushOut();
  }
}

void Link::pushOut() {
  if (!peer_) return;
  const auto buffer = takeBuffer();
  peer_->takeStream(*buffer);
  if (!buffer->empty()) {
    streamBytes_ += buffer->size();
    connection_.send(buffer);
    connection_.flush();
  }
  peer_->takeDatagrams([this](wire::ByteView datagram) { udp_->sendTo(datagram, *udpPeer_); });
  uncounted_ = 0;
}

// use_count() == 1: no connection sends the buffer any more, so reuse its memory.
std::shared_ptr<net::Buffer> Link::takeBuffer() {
  const auto unused =
      std::find_if(buffers_.begin(), buffers_.end(), [](const auto& b) { return b.use_count() == 1; });
  if (unused != buffers_.end()) return *unused;
  buffers_.push_back(std::make_shared<net::Buffer>());
  return buffers_.back();
}

bool Link::reachesServer() {
  if (connected() && net::peerEnd(connection_.nativeHandle()) == net::PeerEnd::none) return true;
  waitUntil([this] { return !announced_; }, kEndTimeout);  // the end has the reason
  return false;
}

std::size_t Link::backlogBytes() const {
  if (!connection_) return 0;
  const net::ConnectionStatistics tcp = connection_.statistics();
  return tcp.queuedBytes + tcp.unacknowledgedBytes;
}

std::uint64_t Link::streamBytesTaken() const {
  return connection_ ? connection_.statistics().bytesOut : 0;
}

void Link::drainTo(std::size_t bytes) {
  flush();
  const std::uint64_t number = connections_;
  std::uint64_t taken = streamBytesTaken();
  base::Nanos lastProgress = base::now();
  while (connected() && connections_ == number && connection_.statistics().queuedBytes > bytes) {
    loop_.runOnce(100ms);
    if (!connected() || connections_ != number) break;
    if (streamBytesTaken() != taken) {
      taken = streamBytesTaken();
      lastProgress = base::now();
      if (onDrainStep) onDrainStep();
    } else if (Duration(base::now() - lastProgress) > options_.sendTimeout) {
      const std::string why = server_.text() + " accepted no data for " +
                              std::to_string(options_.sendTimeout.count()) + " ms; " +
                              std::to_string(connection_.statistics().queuedBytes) + " bytes wait to be sent";
      connection_.abort(why);
      throw ConnectionLost(why);
    }
  }
  if (connections_ == 0) throw ConnectionLost("nothing is sent yet: " + whyNotConnected());
  if (!connected() || connections_ != number) {
    throw ConnectionLost("connection to " + server_.text() + " lost while sending: " + lastFailure_);
  }
}

// --- statistics

void Link::addTraffic(LinkStatistics& statistics) const {
  if (connection_) {
    const net::ConnectionStatistics tcp = connection_.statistics();
    statistics.tcpBytesIn += tcp.bytesIn;
    statistics.tcpBytesOut += tcp.bytesOut;
  }
  if (udp_) {
    statistics.udpBytesIn += udp_->statistics().bytesIn;
    statistics.udpBytesOut += udp_->statistics().bytesOut;
  }
}

LinkStatistics Link::statistics() const {
  LinkStatistics result = statistics_;
  result.connections = connections_;
  addTraffic(result);
  return result;
}

}  // namespace hapticd::client
