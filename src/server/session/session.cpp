#include "server/session/session.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "base/world.h"
#include "net/local_socket.h"
#include "server/config/config.h"
#include "wire/frame_encoder.h"
#include "wire/text.h"

namespace hapticd::server {
namespace {

template <class... Ts>
struct Overloaded : Ts... {
  using Ts::operator()...;
};
template <class... Ts>
Overloaded(Ts...) -> Overloaded<Ts...>;

wire::PeerOptions peerOptions(const net::UdpSocket* udp) {
  wire::PeerOptions options;
  if (udp != nullptr) options.udp = wire::UdpAddress{udp->local().addressText(), udp->local().port};
  return options;
}

}  // namespace

std::string_view nameOf(SessionMode mode) {
  switch (mode) {
    case SessionMode::tcp:
      return "tcp";
    case SessionMode::udp:
      return "udp";
    case SessionMode::web:
      return "web";
    case SessionMode::local:
      break;
  }
  return "local";
}

Session::Session(scene::ClientId id, SessionOwner& owner, const wire::LocalNames& names,
                 const WallClock& clock, net::Connection connection, std::unique_ptr<net::UdpSocket> udp,
                 SessionMode mode)
    : id_(id),
      owner_(owner),
      names_(names),
      clock_(clock),
      connection_(std::move(connection)),
      udp_(std::move(udp)),
      peer_(names, peerOptions(udp_.get())),
      mode_(mode),
      user_(connection_.peerUser()) {
  description_ = user_ ? "user " + std::to_string(*user_) : connection_.remote().text();
  description_ += ", " + std::string(nameOf(mode));
}

ClientStatus Session::status() const {
  ClientStatus status;
  status.id = id_;
  status.address = connection_.remote().text();
  status.mode = nameOf(mode_);
  status.role = nameOf(identity_.role);
  for (const wire::LocalSender name : subscriptions_) {
    status.devices.push_back(names_.senders()[static_cast<std::size_t>(name.value)]);
  }
  status.connected_s = base::toSeconds(base::now() - since_);
  const net::ConnectionStatistics stream = connection_.statistics();
  status.bytesIn = stream.bytesIn;
  status.bytesOut = stream.bytesOut;
  status.dropped = skipped_ + stream.droppedBuffers;
  status.ignoredDatagrams = ignoredDatagrams_;
  status.queuedBytes = stream.queuedBytes;
  status.unacknowledgedBytes = stream.unacknowledgedBytes;
  if (udp_) {
    const net::UdpStatistics& datagrams = udp_->statistics();
    status.bytesIn += datagrams.bytesIn;
    status.bytesOut += datagrams.bytesOut;
    status.dropped += datagrams.dropped;
  }
  return status;
}

std::size_t Session::memory() const {
  return connection_.queuedBytes() + backlog_.size() + peer_.namesBytes();
}

void Session::start() {
  if (udp_) {
    udp_->start(
        {.onDatagram = [this](auto bytes, const auto& from) { onDatagram(bytes, from); }, .onRefused = {}});
  }
  connection_.start({.onConnected = {},
                     .onBytes = [this](auto bytes) { onBytes(bytes); },
                     .onDrained = [this] { onDrained(); },
                     .onPeerGone = [this](const auto& reason) { peerIsGone(reason); },
                     .onClosed = [this](const auto& reason) { onEnd(reason); }});
  flush();
}

bool Session::wants(wire::LocalSender name) const noexcept {
  return peer_.connected() && (subscriptions_.empty() || subscriptions_.count(name) != 0);
}

void Session::sendShared(const std::shared_ptr<const net::Buffer>& frames, net::Delivery delivery) {
  if (!peer_.connected()) return;
  if (delivery == net::Delivery::lowLatency && peer_.usesDatagrams()) {
    wire::cutDatagrams(*frames, [this](wire::ByteView datagram) { udp_->sendTo(datagram, datagramPeer_); });
    return;
  }
  drainPeer();  // keep the order of queued messages
  connection_.send(frames, delivery);
}

void Session::flush() {
  drainPeer();
  connection_.flush();
}

bool Session::release() {
  constexpr std::size_t kSlice_bytes = 64 * 1024;
  held_ = false;
  const std::size_t before = backlog_.size();
  const auto goesOn = [&] {
    return !backlog_.empty() && !held_ && before - backlog_.size() < kSlice_bytes && peer_.connected() &&
           !ending_;
  };
  while (goesOn()) {
    const MessageBacklog::Entry entry = backlog_.pop();
    deliver(entry.message, entry.received);
  }
  owner_.onReadEnd(*this);
  flush();
  if (!backlog_.empty() && !ending_) return !held_;
  pauseReading(false);
  if (closeReason_) closed(*closeReason_);
  return false;
}

// A dropped report may have been the last one of its value.
void Session::onDrained() {
  const std::uint64_t drops = connection_.statistics().droppedBuffers;
  if (std::exchange(dropsSeen_, drops) != drops && peer_.connected()) owner_.onCaughtUp(*this);
}

// Messages that the client sent before it disconnected are still handled.
void Session::onEnd(const std::string& reason) {
  if (!failure_.empty() || backlog_.empty()) {
    closed(failure_.empty() ? reason : failure_);
    return;
  }
  closeReason_ = reason;
  peerIsGone(reason);
}

// What is still held back is not handled.
void Session::closed(const std::string& reason) {
  reportLost();
  owner_.onClosed(*this, reason);
}

void Session::reportLost() {
  while (!backlog_.empty()) noteLost(backlog_.pop().message);
  std::string text;
  for (const auto& [kind, count] : std::exchange(lost_, {}))
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, wire::info(kind).name);
  if (!text.empty()) logWarning("(" + description_ + ") is gone before these were carried out: " + text);
}

void Session::noteLost(const wire::MessageReceived& message) {
  if (!wire::overtakes(message.kind)) ++lost_[message.kind];
  if (message.kind == wire::kindOf<wire::RearmForces>) lostRearms_.insert(message.local_sender);
}

void Session::peerIsGone(const std::string& reason) {
  peerGone_ = true;
  heartbeats_.disable();  // what it sent before is still handled
  owner_.onPeerGone(*this, reason);
}

void Session::pauseReading(bool pause) {
  if (std::exchange(reading_, !pause) == !pause) return;
  if (pause) {
    heartbeats_.pause(base::now());
    connection_.pauseReading();
  } else {
    heartbeats_.resume(base::now());
    connection_.resumeReading();
  }
}

void Session::beginEnd() {
  if (!std::exchange(ending_, true)) owner_.onEnding(*this);
}

void Session::close(const std::string& reason) {
  beginEnd();
  failure_ = reason;
  connection_.close(reason);
}

void Session::abort(const std::string& reason) {
  beginEnd();
  failure_ = reason;
  connection_.abort(reason);
}

void Session::refuse(const std::string& reason) {
  if (inDatagram_) {
    logWarning(reason);
  } else {
    sendLastText(reason);
    close(reason);
  }
}

// Stock clients print only texts of devices that they use.
wire::LocalSender Session::nameOfTexts() const noexcept {
  if (!subscriptions_.empty()) return *subscriptions_.begin();
  return wire::LocalSender{names_.senders().size() > 1 ? 1 : 0};
}

void Session::sendLastText(const std::string& reason) {
  if (!greeted_ || !failure_.empty()) return;
  drainPeer();
  wire::FrameEncoder encoder;  // the protocol's state may be the failure
  encoder.add(clock_.now(), nameOfTexts(),
              wire::Message(wire::Text{
                  .severity = wire::kTextError, .level = 0, .text = reason + "; the connection ends"}));
  net::Buffer bytes;
  encoder.swapOut(bytes);
  connection_.send(std::make_shared<const net::Buffer>(std::move(bytes)));
}

void Session::drainPeer() {
  net::Buffer bytes;
  peer_.takeStream(bytes);
  if (!bytes.empty()) {
    bytes.shrink_to_fit();  // they may wait: a client that does not read must not cost twice what is counted
    connection_.send(std::make_shared<const net::Buffer>(std::move(bytes)));
  }
  if (udp_) {
    peer_.takeDatagrams([this](wire::ByteView datagram) { udp_->sendTo(datagram, datagramPeer_); });
  }
}

void Session::onBytes(std::span<const std::byte> bytes) {
  constexpr std::size_t kSlice_bytes = 8 * 1024;  // takes tens of microseconds
  heartbeats_.receive(base::now());
  while (!bytes.empty() && !peer_.failed()) {
    const auto slice = bytes.first(std::min(kSlice_bytes, bytes.size()));
    bytes = bytes.subspan(slice.size());
    peer_.feed(clock_.now(), slice, [this](const wire::Event& event) { onEvent(event); });
    if (!bytes.empty()) owner_.onReadSlice();
  }
  owner_.onReadEnd(*this);
  if (peer_.failed()) {
    beginEnd();
    if (greeted_) {
      connection_.close(failure_);  // sends the text
    } else {
      connection_.abort(failure_);
    }
    return;
  }
  flush();
}

// Anybody can send datagrams to a port, and forge their address. The socket is this session's own, at a port
// that only this client was told.
void Session::onDatagram(std::span<const std::byte> bytes, const net::Endpoint& from) {
  const bool fromClient =
      from.address == connection_.remote().address && datagramSource_.value_or(from.port) == from.port;
  datagramCounts_ = false;
  if (fromClient) {
    inDatagram_ = true;
    peer_.feedDatagram(bytes, [this](const wire::Event& event) { onEvent(event); });
    inDatagram_ = false;
  }
  if (datagramCounts_) {
    datagramSource_ = from.port;
  } else {
    ++ignoredDatagrams_;
  }
  owner_.onReadEnd(*this);
  flush();
}

void Session::onEvent(const wire::Event& event) {
  std::visit(Overloaded{[this](const wire::MessageReceived& message) { onReceived(message); },
                        [this](const wire::Connected& connected) {
                          owner_.onNote(*this, "speaks VRPN " + std::string(connected.version));
                          greeted_ = true;
                          owner_.onConnected(*this);
                        },
                        [this](const wire::SenderDescribed& described) { onSender(described.name); },
                        [](const wire::TypeDescribed&) {},
                        [this](const wire::UdpDescribed& described) { onUdp(described.address); },
                        [this](const wire::LogRequested& requested) { onLogRequest(requested.request); },
                        [this](const wire::Ignored& ignored) {
                          spdlog::debug("client {}: {} ({})", id_, ignored.reason, ignored.value);
                        },
                        [this](const wire::ProtocolError& error) {
                          sendLastText(std::string(error.reason));
                          failure_ = std::string(error.reason);
                        }},
             event);
}

void Session::onReceived(const wire::MessageReceived& message) {
  // VRPN ignores messages of senders and types that the receiver does not know.
  if (message.local_sender.value < 0 || message.kind == wire::kUnknownKind) return;
  if (ending_ && message.kind != wire::kindOf<wire::StopForces>) {
    if (!inDatagram_) noteLost(message);
    return;
  }
  // Whatever stock clients send by TCP only is forged here.
  const wire::MessageInfo& info = wire::info(message.kind);
  if (inDatagram_ && (info.reliability != wire::Reliability::kLowLatency || info.role != wire::Role::scene))
    return;
  if (isStale(message)) return;
  if (inDatagram_) datagramCounts_ = true;
  const base::Nanos received = base::now();
  if (isOneTooMany(message.kind, received)) {
    refuse("more than " + std::to_string(mostPerSecond_) + " messages in a second; send fewer");
    return;
  }
  if (!holding() || wire::overtakes(message.kind)) {
    deliver(message, received);
    return;
  }
  const bool full = backlog_.size() >= kReadAhead_bytes;
  if (full && inDatagram_) return;  // drop it: pausing the TCP connection does not stop datagrams
  backlog_.push(message, received);
  if (backlog_.size() >= kReadAhead_bytes) pauseReading(true);
}

void Session::deliver(const wire::MessageReceived& message, base::Nanos received) {
  if (message.kind == wire::kindOf<wire::Heartbeat>) {
    onHeartbeat(message, received);
  } else {
    owner_.onMessage(*this, message, received);
  }
}

void Session::onHeartbeat(const wire::MessageReceived& message, base::Nanos received) {
  const auto heartbeat = wire::decode<wire::Heartbeat>(message.payload);
  if (!heartbeat) {
    refuse("malformed message: " + heartbeat.error());
  } else if (heartbeat->watch != 0 ? heartbeats_.beat(received) : heartbeats_.disable()) {
    owner_.onHeartbeatAgain(*this);
  }
}

// A client ends a force field or a plane by TCP, or resets the scene. A datagram that it sent earlier may
// arrive later and must not start it again. One that seems older by more than any travel tells of a clock
// that was set.
bool Session::isStale(const wire::MessageReceived& message) {
  constexpr std::int64_t kLongestTravel_us = 10'000'000;
  const auto microseconds = [](const wire::Time& time) {
    return std::int64_t{time.seconds} * 1'000'000 + time.microseconds;
  };
  wire::Time& last = lastReliable_[static_cast<std::size_t>(message.kind)];
  if (!inDatagram_) {
    last = message.time;
    if (message.kind == wire::kindOf<wire::ResetScene>) lastReliable_.fill(message.time);
    return false;
  }
  const std::int64_t older_us = microseconds(last) - microseconds(message.time);
  return older_us > 0 && older_us <= kLongestTravel_us;
}

// The number of messages that fill meshes is bounded by the meshes, and their bytes by the queue.
bool Session::isOneTooMany(wire::MessageKind kind, base::Nanos received) {
  constexpr base::Nanos kSecond = 1'000'000'000;
  constexpr std::array kUncounted{wire::kindOf<wire::StopForces>, wire::kindOf<wire::SetVertex>,
                                  wire::kindOf<wire::SetTriangle>, wire::kindOf<wire::MeshVertices>,
                                  wire::kindOf<wire::MeshTriangles>};
  if (std::find(kUncounted.begin(), kUncounted.end(), kind) != kUncounted.end()) return false;
  if (received - secondBegan_ >= kSecond) {
    secondBegan_ = received;
    inThisSecond_ = 0;
  }
  return inThisSecond_++ >= mostPerSecond_;
}

void Session::onSender(std::string_view name) {
  const auto sender = names_.findSender(name);
  if (sender) {
    // Every stock client describes "VRPN Control", also one that only listens.
    if (sender->value == 0) return;
    if (std::exchange(logsRefused_, false)) refuseLogs(*sender);
    if (subscriptions_.insert(*sender).second) owner_.onSubscribed(*this, *sender);
    return;
  }
  std::string devices;
  for (std::size_t i = 1; i < names_.senders().size(); ++i) devices += ' ' + names_.senders()[i];
  const bool isMirror = std::any_of(kMirrors.begin(), kMirrors.end(), [&](const auto& mirror) {
    const std::string_view suffix = mirror.second;
    return name.ends_with(suffix) && names_.findSender(name.substr(0, name.size() - suffix.size()));
  });
  logWarning("requested the device " + wire::inQuotes(name) + ", which does not exist; available:" + devices +
             (isMirror ? "; 'mirrors = true' in its [[device]] offers it" : ""));
}

void Session::onUdp(const wire::UdpAddress& address) {
  peer_.useDatagrams(false);  // the description replaces an earlier one, even when it is refused
  net::Endpoint described;
  try {
    described = net::Endpoint::parse(address.host, address.port);
  } catch (const net::Error& error) {
    logWarning(std::string("UDP address refused: ") + error.what());
    return;
  }
  if (described.address != connection_.remote().address) {
    logWarning("requested datagrams to " + described.text() +
               ", which is not its own address; using TCP only");
    return;
  }
  datagramPeer_ = described;
  peer_.useDatagrams(udp_ != nullptr);
}

// Never write to a path that a client chose.
void Session::onLogRequest(const wire::LogRequest& request) {
  logWarning("requested log files " + wire::inQuotes(request.inName) + ", " +
             wire::inQuotes(request.outName) + ": refused");
  // Stock clients print only texts of devices that they use, and describe those later.
  logsRefused_ = subscriptions_.empty();
  refuseLogs(logsRefused_ ? wire::LocalSender{0} : *subscriptions_.begin());
}

void Session::refuseLogs(wire::LocalSender from) {
  send(from, wire::Text{.severity = wire::kTextWarning,
                        .level = 0,
                        .text = std::string("log files on the server are refused; log on the client")});
}

}  // namespace hapticd::server
