// What servers of this project can do beyond VRPN; see docs/wire-extensions.md.
#include <cmath>
#include <stdexcept>

#include "client/client_impl.h"
#include "wire/codec.h"

namespace hapticd {

using namespace std::chrono_literals;

namespace {

constexpr auto kHeartbeatInterval = 100ms;

}  // namespace

// --- what the server can do

void Client::Impl::greet() {
  offer.reset();
  answered = false;
  link.sendNow(sender, wire::QueryCapabilities{});
  if (subscription) link.sendNow(sender, *subscription);
  if (heartbeats) link.sendNow(sender, wire::Heartbeat{1});
}

// A server answers in the order of the questions. The link asks whether the device is there after greet()
// asked what it can do: an answer to the second without one to the first means that it does not know the
// first.
void Client::Impl::arriving(wire::MessageKind kind, wire::LocalSender from, wire::ByteView payload) {
  if (from != sender) return;
  if (kind == wire::kindOf<wire::Pong>) answered = true;
  if (kind != wire::kindOf<wire::Capabilities>) return;
  const auto message = wire::decode<wire::Capabilities>(payload);
  if (!message) return;
  offer = *message;
  answered = true;
}

bool Client::Impl::waitAnswered() {
  if (answered && link.connected()) return true;
  const std::uint64_t number = link.connectionNumber();
  const auto over = [&] { return answered || !link.connected() || link.connectionNumber() != number; };
  link.waitUntil(over, std::max<Duration>(options.connect_timeout, 1s));
  return answered && link.connected();
}

void Client::Impl::require(wire::Feature feature, std::string_view what) {
  if (!link.connected()) waitConnected(options.connect_timeout);
  if (!waitAnswered()) {
    if (!link.connected())
      throw ConnectionLost("connection to " + server + " lost: " + link.whyNotConnected());
    throw ConnectError("device '" + device + "' at " + server + " does not say what it can do");
  }
  if (has(feature)) return;
  throw Unsupported("cannot " + std::string(what) + ": " +
                    (offer ? "device '" + device + "' at " + server + " does not support it"
                           : server + " is a VRPN server without the extensions of hapticd"));
}

std::optional<Capabilities> Client::capabilities() const {
  if (!impl_->offer || !connected()) return std::nullopt;
  const wire::Capabilities& c = *impl_->offer;
  const auto& w = c.workspace;
  return Capabilities{c.version,
                      impl_->has(wire::kFeatureBulkMesh),
                      impl_->has(wire::kFeatureBatch),
                      impl_->has(wire::kFeatureSubscribe),
                      impl_->has(wire::kFeatureStop),
                      impl_->has(wire::kFeatureHeartbeat),
                      impl_->has(wire::kFeatureHoldHand),
                      c.servo_rate,
                      c.report_rate,
                      c.peak_force,
                      c.buttons,
                      {w[0], w[1], w[2]},
                      {w[3], w[4], w[5]}};
}

std::optional<Capabilities> Client::waitCapabilities() {
  if (!connected()) waitConnected(impl_->options.connect_timeout);
  impl_->waitAnswered();
  return capabilities();
}

// --- batches

void Client::batch(const std::function<void()>& commands) {
  client::Link& link = impl_->link;
  if (link.holding()) throw std::logic_error("batch() inside batch(): batches do not nest");
  impl_->require(wire::kFeatureBatch, "make several changes visible at once");
  const std::uint64_t number = link.connectionNumber();
  client::HeldBatch held(link);
  commands();
  if (!link.connected() || link.connectionNumber() != number) {
    throw ConnectionLost("connection to " + server() +
                         " lost before a batch was complete; nothing of it was sent");
  }
  held.commit(impl_->sender);
}

// --- reports of one's own choice

void Client::subscribe(Reports kinds, double rate_Hz) {
  if (!std::isfinite(rate_Hz) || rate_Hz < 0) {
    throw std::invalid_argument("a report rate of " + std::to_string(rate_Hz) +
                                " Hz: give 0 (as it is) or more");
  }
  if (connected()) impl_->require(wire::kFeatureSubscribe, "choose reports");
  impl_->subscription = wire::Subscribe{static_cast<std::uint32_t>(kinds), rate_Hz};
  if (connected()) impl_->link.sendNow(impl_->sender, *impl_->subscription);
}

// --- safety

// A stop must not wait for an answer: it is sent first, and a server that does not know it ignores it.
void Client::stopForces() {
  if (!impl_->link.sendNow(impl_->sender, wire::StopForces{})) {
    throw ConnectionLost("forces not stopped: " + impl_->link.whyNotConnected());
  }
  impl_->require(wire::kFeatureStop, "stop the forces");
}

void Client::rearmForces() {
  impl_->require(wire::kFeatureStop, "re-arm the forces");
  impl_->link.sendNow(impl_->sender, wire::RearmForces{});
}

void Client::enableHeartbeat(bool enable) {
  if (connected()) impl_->require(wire::kFeatureHeartbeat, "be watched by heartbeats");
  impl_->heartbeats = enable;
  impl_->heartbeat_timer.cancel();
  if (connected()) impl_->link.sendNow(impl_->sender, wire::Heartbeat{static_cast<wire::Bool16>(enable)});
  if (!enable) return;
  impl_->heartbeat_timer = impl_->link.every(kHeartbeatInterval, [impl = impl_.get()] {
    if (impl->link.connected()) impl->link.sendNow(impl->sender, wire::Heartbeat{1});
  });
}

// --- the simulated hand

// Reliably, so that no pose comes after the release and takes the hand again.
void Client::holdHand(const HandPose& pose) {
  if (connected()) impl_->require(wire::kFeatureHoldHand, "hold the hand");
  impl_->link.sendNow(impl_->sender, wire::HoldHand{1, pose.position, pose.orientation, pose.buttons});
}

void Client::releaseHand() {
  if (connected()) impl_->require(wire::kFeatureHoldHand, "let go of the hand");
  impl_->link.sendNow(impl_->sender, wire::HoldHand{});
}

}  // namespace hapticd
