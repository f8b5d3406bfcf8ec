#include "sim/sim_client.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "net/client_frames.h"
#include "net/local_socket.h"
#include "wire/text.h"
#include "wire/udp_request.h"

namespace hapticd::sim {

using namespace std::chrono_literals;

SimClient::SimClient(Clients& all, std::string name) : all_(all), name_(std::move(name)) {
  names_.addSender("VRPN Control");
  device_ = names_.addSender("Phantom");
}

wire::Time SimClient::wallTime() const {
  const Nanos wall = all_.clock.wallNow();
  return {static_cast<std::uint32_t>(wall / 1'000'000'000),
          static_cast<std::uint32_t>(wall % 1'000'000'000 / 1000)};
}

void SimClient::connect() {
  orders_.clear();
  sent_ = read_ = 0;
  lastTick = 0;
  asked_ = all_.clock.now();
  closed_ = false;
  mayEnd_ = false;
  touched_.reset();
  disagreesSince_.reset();
  guardReports = 0;
  web_ = {};
  if (way == Way::datagrams) {
    const net::Endpoint here{net::kLoopbackAddress, 0};
    listener_.emplace(all_.loop, here, [this](net::Connection connection) { adopt(std::move(connection)); });
    udp_.emplace(all_.loop, here);
    udp_->start({.onDatagram =
                     [this](auto bytes, const net::Endpoint&) {
                       peer_->feedDatagram(bytes, [this](const wire::Event& event) { onEvent(event); });
                     },
                 .onRefused = {}});
    options_.udp = {here.addressText(), udp_->local().port};
    peer_.emplace(names_, options_);
    asking_ = all_.loop.every(std::chrono::nanoseconds(askPeriod), [this] { askToConnect(); });
    return askToConnect();
  }
  peer_.emplace(names_, options_);
  net::ConnectionOptions connection;
  connection.hardLimitBytes = std::size_t{256} << 20;
  if (way == Way::local) return adopt(net::connectLocal(all_.loop, all_.socket, connection));
  adopt(net::Connection::connect(all_.loop, way == Way::web ? all_.web : all_.server, 2s, connection));
}

// A datagram may be lost.
void SimClient::askToConnect() {
  if (connection_ || closed_) return;
  const std::string request =
      wire::formatUdpRequest({listener_->local().addressText(), listener_->local().port});
  udp_->sendTo(wire::asBytes(request), all_.server);
}

void SimClient::adopt(net::Connection connection) {
  if (closed_ || (connection_ && way == Way::datagrams)) return;  // an answer to each request
  connection_ = std::move(connection);
  connection_.start({.onConnected = {},
                     .onBytes = [this](auto bytes) { receive(bytes); },
                     .onDrained = {},
                     .onPeerGone = {},
                     .onClosed =
                         [this](const std::string& reason) {
                           // It had a descriptor for the connection and none for the datagrams.
                           if (way == Way::datagrams && !connected() && all_.shortOfDescriptors()) {
                             peer_.emplace(names_, options_);
                             connection_ = {};  // and asks again
                             return;
                           }
                           closed_ = true;
                           // While the machine stands still nobody answers.
                           if (mayEnd_ || reason.starts_with("cannot connect")) return;
                           all_.finding("client '" + name_ +
                                        "', which did nothing wrong, was disconnected: " + reason +
                                        (texts.empty() ? "" : "; last text: " + texts.back()));
                         }});
  if (way == Way::web) {
    const std::string greeting = webGreeting(all_.web.text());
    sendRaw(std::as_bytes(std::span(greeting)));
  }
  flush();
}

void SimClient::receive(std::span<const std::byte> bytes) {
  std::vector<std::byte> payload;
  if (way == Way::web) {
    try {
      payload = web_.take(bytes);
    } catch (const std::exception& error) {
      return all_.finding("client '" + name_ + "': " + error.what());
    }
    bytes = payload;
  }
  peer_->feed(wallTime(), bytes, [this](const wire::Event& event) { onEvent(event); });
  flush();
}

void SimClient::reset() {
  mayEnd_ = closed_ = true;
  if (connection_) connection_.abort("reset");
}

void SimClient::flush() {
  std::vector<std::byte> bytes;
  peer_->takeStream(bytes);
  if (!bytes.empty()) sendBytes(bytes);
  peer_->takeDatagrams([this](wire::ByteView datagram) {
    if (udpPeer_) udp_->sendTo(datagram, *udpPeer_);
  });
}

void SimClient::sendBytes(std::span<const std::byte> bytes) {
  if (way != Way::web) return sendRaw(bytes);
  const std::string frame =
      net::clientFrame(net::kBinary, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  sendRaw(std::as_bytes(std::span(frame)));
}

void SimClient::sendRaw(std::span<const std::byte> bytes) {
  sent_ += bytes.size();
  connection_.send(bytes);
  connection_.flush();
}

void SimClient::stopForces() {
  send(wire::StopForces{});
  orders_.push_back({sent_, true, {}});
  ++all_.stops;
}

void SimClient::rearmForces() {
  send(wire::RearmForces{});
  orders_.push_back({sent_, false, {}});
}

void SimClient::onArrived(std::uint64_t total) {
  for (Order& order : orders_) {
    if (order.arrived || order.end > total) continue;
    order.arrived = all_.clock.now();
    order.stalled = all_.netStalled();
  }
}

void SimClient::onRead(std::uint64_t total) {
  constexpr Nanos kLongest = 5'000'000;
  read_ = total;
  while (!orders_.empty() && orders_.front().end <= total) {
    const Order order = orders_.front();
    orders_.pop_front();
    const Nanos now = all_.clock.now();
    if (!order.stop) {
      all_.rearmRead(now);
      continue;
    }
    all_.stopRead(now);
    const Nanos took = now - order.arrived.value_or(now) - (all_.netStalled() - order.stalled);
    if (sendsAhead) continue;
    all_.slowestStop = std::max(all_.slowestStop, took);
    if (took > kLongest)
      all_.finding("the server read a stop of client '" + name_ + "' " + std::to_string(took / 1000) +
                   " us after it arrived");
  }
}

void SimClient::onEvent(const wire::Event& event) {
  if (std::holds_alternative<wire::Connected>(event)) {
    if (identifies && way != Way::local) {
      wire::Identify identify;
      identify.token = Clients::kToken;
      queue(identify);
    }
    onConnected();
  } else if (const auto* message = std::get_if<wire::MessageReceived>(&event)) {
    onMessage(*message);
  } else if (const auto* udp = std::get_if<wire::UdpDescribed>(&event)) {
    udpPeer_ = net::Endpoint::parse(udp->address.host, udp->address.port);
    peer_->useDatagrams();
  } else if (const auto* error = std::get_if<wire::ProtocolError>(&event)) {
    all_.finding("client '" + name_ + "' got bytes that break the protocol: " + std::string(error->reason));
  }
}

void SimClient::onMessage(const wire::MessageReceived& message) {
  if (message.kind == wire::kindOf<wire::TickReport>) {
    const auto tick = wire::decode<wire::TickReport>(message.payload);
    ++tickReports;
    if (way == Way::datagrams && tick->tick < lastTick) return;  // overtaken
    if (tick->tick < lastTick)                                   // the present state may repeat one
      all_.finding("client '" + name_ + "' got tick " + std::to_string(tick->tick) + " after tick " +
                   std::to_string(lastTick));
    if (lastTick != 0) missedTicks += tick->tick - lastTick - 1;
    lastTick = tick->tick;
    lastRevision = tick->revision;
    compare(*tick);
  } else if (message.kind == wire::kindOf<wire::TouchedObject>) {
    touched_ = wire::decode<wire::TouchedObject>(message.payload)->object;
    if (onTouched) onTouched();
  } else if (message.kind == wire::kindOf<wire::Dop>) {
    depth_ = wire::decode<wire::Dop>(message.payload)->depth;
  } else if (message.kind == wire::kindOf<wire::GuardState>) {
    guard = *wire::decode<wire::GuardState>(message.payload);
    ++guardReports;
  } else if (message.kind == wire::kindOf<wire::ButtonChange>) {
    const auto change = wire::decode<wire::ButtonChange>(message.payload);
    ++buttonReports;
    const auto index = static_cast<std::size_t>(change->button);
    if (index < buttons.size()) buttons[index] = static_cast<std::uint32_t>(change->state);
  } else if (message.kind == wire::kindOf<wire::Text>) {
    texts.push_back(wire::decode<wire::Text>(message.payload)->text.text);
    all_.heard(name_, texts.back());
    // Its messages come in any order: it may have left a batch open.
    const bool batchOpen = texts.back().ends_with("a batch is open; commit it first");
    if (texts.back().starts_with("Rearm_Forces refused") && identifies && !batchOpen)
      all_.finding("client '" + name_ + "' proved that it is an owner and is refused: " + texts.back());
    onText(texts.back());
  }
}

// One that was behind gets the present state when it has caught up: it does not wait for further changes.
void SimClient::compare(const wire::TickReport& tick) {
  constexpr Nanos kLongest = 100 * kMs;
  constexpr double kSmallest_m = 2e-5;  // twice the change of a depth that is reported
  if (!touched_ || way == Way::datagrams) return;
  if (*touched_ == tick.object && std::abs(depth_ - tick.depth) <= kSmallest_m) {
    disagreesSince_.reset();
    return;
  }
  const Nanos now = all_.clock.now();
  if (!disagreesSince_) disagreesSince_ = now;
  if (now - *disagreesSince_ <= kLongest) return;
  all_.finding("client '" + name_ + "' has known for " + std::to_string((now - *disagreesSince_) / kMs) +
               " ms that the hand touches object " + std::to_string(*touched_) + " at a depth of " +
               std::to_string(depth_) + ", and tick " + std::to_string(tick.tick) + " has object " +
               std::to_string(tick.object) + " and " + std::to_string(tick.depth));
  touched_.reset();
}

}  // namespace hapticd::sim
