// The extensions of VRPN by servers of this project; see docs/wire-extensions.md.
#include <cmath>
#include <stdexcept>

#include "base/world.h"
#include "client/client_impl.h"
#include "wire/codec.h"
#include "wire/text.h"

namespace hapticd {

using namespace std::chrono_literals;

namespace {

constexpr auto kHeartbeatInterval = 100ms;
// A stop on the first connection waits behind no more than this; beyond it, it also takes a second
// connection.
constexpr std::size_t kStopBacklogBytes = 64 * 1024;

}  // namespace

// --- capabilities

void Client::Impl::greet() {
  offer.reset();
  answered = false;
  link.sendNow(sender, wire::QueryCapabilities{});
  if (!token.empty()) link.sendNow(sender, identity());
  if (subscription) link.sendNow(sender, *subscription);
  if (updateRate_Hz) link.sendNow(sender, wire::TrackerSetUpdateRate{*updateRate_Hz});
  if (heartbeats) link.sendNow(sender, wire::Heartbeat{1});
}

// Servers answer in order. greet() asks for the capabilities before the link pings the device, so a pong
// without capabilities before it means that the server does not know the question.
void Client::Impl::onArrival(wire::MessageKind kind, wire::LocalSender from, wire::ByteView payload) {
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
  link.waitUntil(over, std::max<Duration>(options.connectTimeout, 1s));
  return answered && link.connected();
}

void Client::Impl::requireExtensions(std::string_view what) {
  if (!link.connected()) waitConnected(options.connectTimeout);
  if (!waitAnswered()) {
    if (!link.connected())
      throw ConnectionLost("connection to " + server + " lost: " + link.whyNotConnected());
    throw ConnectError("device '" + device + "' at " + server +
                       " did not answer the question for its capabilities");
  }
  if (offer) return;
  throw Unsupported("cannot " + std::string(what) + ": " + server +
                    " is a VRPN server without the extensions of hapticd");
}

void Client::Impl::require(wire::Feature feature, std::string_view what) {
  requireExtensions(what);
  if (has(feature)) return;
  throw Unsupported("cannot " + std::string(what) + ": device '" + device + "' at " + server +
                    " does not support it");
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
                      c.servoRate,
                      c.reportRate,
                      c.peakForce,
                      c.buttons,
                      {w[0], w[1], w[2]},
                      {w[3], w[4], w[5]},
                      impl_->has(wire::kFeatureRemoteContacts)};
}

std::optional<Capabilities> Client::waitCapabilities() {
  if (!connected()) waitConnected(impl_->options.connectTimeout);
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

// --- choice of reports

void Client::subscribe(Reports kinds, double rate_Hz) {
  if (!std::isfinite(rate_Hz) || rate_Hz < 0) {
    throw std::invalid_argument("a report rate of " + std::to_string(rate_Hz) +
                                " Hz: give 0 (as it is) or more");
  }
  if (connected()) impl_->require(wire::kFeatureSubscribe, "choose reports");
  impl_->subscription = wire::Subscribe{static_cast<std::uint32_t>(kinds), rate_Hz};
  if (rate_Hz > 0) impl_->updateRate_Hz.reset();
  if (connected()) impl_->link.sendNow(impl_->sender, *impl_->subscription);
}

// --- safety

// Send the stop before asking whether the server knows it: a server that does not ignores it.
void Client::stopForces() {
  const bool behind = impl_->link.backlogBytes() > kStopBacklogBytes;
  const bool beside = behind && (!impl_->answered || impl_->has(wire::kFeatureStop));
  impl_->sendKey();
  if (beside) {
    impl_->link.sendNow(impl_->sender, wire::StopForces{});
    impl_->stopBesideBacklog();
  } else {
    impl_->sendAtOnce(wire::StopForces{}, "forces not stopped");
  }
  impl_->require(wire::kFeatureStop, "stop the forces");
}

void Client::Impl::requireFits(std::string_view call, std::string_view text, std::size_t most) {
  if (text.size() > most)
    throw std::invalid_argument(std::string(call) + ": " + std::to_string(text.size()) +
                                " bytes of text; at most " + std::to_string(most));
  if (text.find('\0') != std::string_view::npos)  // the receiver would take it for the end
    throw std::invalid_argument(std::string(call) + ": the text " + wire::inQuotes(text) +
                                " has a NUL character");
}

void Client::mark(std::string_view text) {
  Impl::requireFits("mark()", text, decltype(wire::Marker::text)::kMost);
  impl_->sendAtOnce(wire::Marker{.time = 0, .text = std::string(text)}, "not marked");
  impl_->requireExtensions("mark a moment");
}

void Client::setObjectName(int object, std::string_view name) {
  Impl::requireFits("setObjectName()", name, decltype(wire::SetObjectName::text)::kMost);
  impl_->send(wire::SetObjectName{object, name});
}

// The stop on the first connection stays where it is: a re-arm, which follows it there, then ends both.
void Client::Impl::stopBesideBacklog() {
  constexpr Duration kSlice = 5ms;
  client::Link beside(link.resolvedServer(), {.reconnect = false, .sendTimeout = client::Link::kEndTimeout});
  const wire::LocalSender target = beside.addSender(device);
  bool confirmed = false;
  bool sent = false;
  beside.onArrival = [&](wire::MessageKind kind, wire::LocalSender from, wire::ByteView) {
    confirmed = confirmed || (sent && from == target && kind == wire::kindOf<wire::Pong>);
  };
  const base::Nanos start = base::now();
  const Duration timeout = std::max<Duration>(options.connectTimeout, 1s);
  while (!confirmed && Duration(base::now() - start) < timeout) {
    if (!sent && beside.connected()) {
      // The server handles the messages of a connection in order, so the pong confirms the stop.
      sent = beside.sendNow(target, identity()) && beside.sendNow(target, wire::StopForces{}) &&
             beside.sendNow(target, wire::Ping{});
    }
    beside.waitUntil([&] { return confirmed || (!sent && beside.connected()); }, kSlice);
    link.runOnce();  // heartbeats
  }
  if (!confirmed) {
    throw ConnectError("stop not confirmed: it waits behind " + std::to_string(link.backlogBytes()) +
                       " bytes, and a second connection to " + server + " got no answer" +
                       (beside.connected() ? "" : ": " + beside.whyNotConnected()));
  }
}

void Client::rearmForces() {
  impl_->require(wire::kFeatureStop, "re-arm the forces");
  impl_->sendKey();
  impl_->sendAtOnce(wire::RearmForces{}, "forces not re-armed");
}

void Client::presentToken(std::string_view token) {
  if (!token.empty() &&
      (token.size() < wire::Identify::kShortestToken || token.size() > wire::Identify::kLongestToken)) {
    throw std::invalid_argument("presentToken(): " + std::to_string(token.size()) +
                                " characters; a token has 16 to 128");
  }
  Impl::requireFits("presentToken()", token, wire::Identify::kLongestToken);
  impl_->token = token;
  if (connected() && !token.empty()) impl_->link.sendNow(impl_->sender, impl_->identity());
}

void Client::enableHeartbeat(bool enable) {
  if (connected()) impl_->require(wire::kFeatureHeartbeat, "watch the heartbeat");
  impl_->heartbeats = enable;
  impl_->heartbeatTimer.cancel();
  if (connected()) impl_->link.sendNow(impl_->sender, wire::Heartbeat{static_cast<wire::Bool16>(enable)});
  if (!enable) return;
  impl_->heartbeatTimer = impl_->link.every(kHeartbeatInterval, [impl = impl_.get()] {
    if (impl->link.connected()) impl->link.sendNow(impl->sender, wire::Heartbeat{1});
  });
}

// --- streamed state

namespace {

void append(std::vector<double>& numbers, const std::array<double, 3>& v) {
  numbers.insert(numbers.end(), v.begin(), v.end());
}

}  // namespace

void Client::setRemoteContacts(std::span<const RemoteContact> contacts) {
  if (contacts.size() > wire::RemoteContacts::kMost) {
    throw std::invalid_argument("setRemoteContacts(): " + std::to_string(contacts.size()) +
                                " contacts; give the 16 nearest to the hand");
  }
  if (connected()) impl_->require(wire::kFeatureRemoteContacts, "stream contacts");
  const bool isOfThisServer = impl_->connectionsReported == impl_->link.connectionNumber();
  const std::int64_t stateTime = isOfThisServer ? impl_->latest.hand.tickTime.count() : 0;
  wire::RemoteContacts message{.time = base::now(), .stateTime = stateTime, .contacts = {}};
  std::vector<double>& numbers = message.contacts.values;
  numbers.reserve(contacts.size() * wire::RemoteContacts::kNumbers);
  for (const RemoteContact& c : contacts) {
    numbers.insert(numbers.end(), {double(c.id), double(static_cast<int>(c.shape)), c.radius_m});
    append(numbers, c.point_m);
    append(numbers, c.normal);
    append(numbers, c.axis);
    append(numbers, c.velocity_m_per_s);
    append(numbers, c.angularVelocity_rad_per_s);
    numbers.insert(numbers.end(),
                   {c.stiffness_N_per_m, c.damping_Ns_per_m, c.staticFriction, c.dynamicFriction,
                    std::chrono::duration<double>(c.lifetime).count(), c.yields ? 1.0 : 0.0});
  }
  impl_->link.sendNow(impl_->sender, message);
}

void Client::setForce(const std::array<double, 3>& force_N, const std::array<double, 3>& torque_Nm,
                      Duration lifetime) {
  if (connected()) impl_->require(wire::kFeatureRemoteContacts, "hold a force");
  impl_->link.sendNow(impl_->sender, wire::HeldForce{base::now(), force_N, torque_Nm,
                                                     std::chrono::duration<double>(lifetime).count()});
}

// --- the simulated hand

// Sent reliably: a datagram that arrives after the release would take the hand again.
void Client::holdHand(const HandPose& pose) {
  if (connected()) impl_->require(wire::kFeatureHoldHand, "hold the hand");
  impl_->link.sendNow(impl_->sender, wire::HoldHand{1, pose.position, pose.orientation, pose.buttons});
}

void Client::releaseHand() {
  if (connected()) impl_->require(wire::kFeatureHoldHand, "release the hand");
  impl_->link.sendNow(impl_->sender, wire::HoldHand{});
}

}  // namespace hapticd
