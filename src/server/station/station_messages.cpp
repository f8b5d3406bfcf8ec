// Control messages of clients: queries, subscriptions, stop, re-arm and steering.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <utility>

#include "server/station/replies.h"
#include "server/station/station_impl.h"
#include "wire/dispatch.h"
#include "wire/text.h"

namespace hapticd::server {
namespace {

void sendText(Session& session, wire::LocalSender name, std::uint32_t severity, const std::string& text) {
  session.send(name, wire::Text{.severity = severity, .level = 0, .text = text});
}

}  // namespace

void Station::shareControlWith(const Station& other) {
  impl_->roles = other.impl_->roles;
}

bool Station::mayCommand(const Commander& client, wire::MessageKind kind, std::string& reason) {
  if (impl_->replayed) {
    reason = "this server replays a recording, which cannot be changed";
    return false;
  }
  // Anybody may undo their own stop: the device decides.
  if (kind == wire::kindOf<wire::RearmForces>) return true;
  const bool owns = wire::access(kind) == wire::Access::command;
  if (client.identity.role < (owns ? ClientRole::owner : ClientRole::operating)) {
    reason = "your role is " + std::string(nameOf(client.identity.role)) + "; present the token of an " +
             (owns ? "owner" : "operator or owner");
    return false;
  }
  Roles& roles = *impl_->roles;
  const bool takes = wire::role(kind) == wire::Role::scene;
  if (takes ? roles.mayCommand(client.id, client.address) : roles.couldCommand(client.id, client.address))
    return true;
  // An operator by name has the arm even while somebody else has the scene.
  if (!owns && client.identity.proven) return true;
  reason = roles.reason();
  return false;
}

bool Station::letsGo(scene::ClientId client, const wire::MessageReceived& message) const {
  if (message.kind != wire::kindOf<wire::HoldHand> || impl_->control.holder() != client) return false;
  const auto decoded = wire::decode<wire::HoldHand>(message.payload);
  return decoded && decoded->hold == 0;
}

Refusal Station::holdForce(scene::ClientId client, const geometry::Vec3& force_N, base::Nanos lifetime,
                           base::Nanos received) {
  return impl_->streamed.on(client, force_N, lifetime, received).text;
}

void Station::onControl(Session& session, const wire::MessageReceived& message, base::Nanos received,
                        bool hasOperators, bool hasSocket) {
  const base::Nanos sent =
      message.time.seconds * base::Nanos{1'000'000'000} + message.time.microseconds * base::Nanos{1000};
  const Identity& identity = session.identity();
  const bool operates = identity.role >= ClientRole::operating;
  const Request request{
      session,
      message.local_sender,
      {received, sent, session.address(), session.id()},
      {.client = session.id(),
       .key = session.key(),
       .description = "client " + std::to_string(session.id()) + " (" + session.description() + ")",
       .mayCommand =
           operates && (identity.proven || impl_->roles->couldCommand(session.id(), session.address())),
       .isOperator = operates && identity.proven,
       .isPage = operates && session.ofPage(),
       .hasOperators = hasOperators,
       .hasSocket = hasSocket}};
  const auto handled = wire::dispatchControl(message.kind, message.payload,
                                             [&](const auto& control) { impl_->on(request, control); });
  if (!handled) session.refuse("malformed message: " + handled.error());
}

void Station::Impl::on(const Request& request, const wire::Ping&) {
  const bool touching = outbox.last().rendering.touching;
  request.session.send(request.name, wire::Pong{});
  request.session.send(
      request.name,
      outbox.reporterFor(request.session.id(), request.name).buttonStates(frame.buttons, touching));
}

void Station::Impl::on(const Request& request, const wire::Text& text) {
  request.session.logWarning("sent the text " + wire::inQuotes(text.text.text));
}

void Station::Impl::on(const Request& request, const wire::TrackerRequestToRoom&) {
  whenApplied(request.session,
              [this, name = request.name](Session& session) { session.send(name, trackerToRoom(frame)); });
}

void Station::Impl::on(const Request& request, const wire::TrackerRequestUnitToSensor&) {
  const std::int32_t sensors = outbox.reporterFor(request.session.id(), request.name).sensorCount();
  for (std::int32_t sensor = 0; sensor < sensors; ++sensor) {
    request.session.send(request.name,
                         wire::TrackerUnitToSensor{
                             .sensor = sensor, .filler = 0, .position = {}, .orientation = {0, 0, 0, 1}});
  }
}

void Station::Impl::on(const Request& request, const wire::TrackerRequestWorkspace&) {
  whenApplied(request.session, [this, name = request.name](Session& session) {
    session.send(name, trackerWorkspace(workspaceOf(config, profile), lastTickNow()));
  });
}

void Station::Impl::on(const Request& request, const wire::TrackerSetUpdateRate& wanted) {
  const double present_Hz = outbox.choiceOf(request.session.id()).rate_Hz;
  if (const auto rate_Hz = chosenRate(request, wanted.rate, present_Hz, "set_update_rate"))
    outbox.setRate(request.session, *rate_Hz);
}

void Station::Impl::on(const Request& request, const wire::Subscribe& wanted) {
  ReportChoice choice = outbox.choiceOf(request.session.id());
  choice.kinds = wanted.kinds & wire::kReportAll;
  const auto rate_Hz = chosenRate(request, wanted.rate, choice.rate_Hz, "Subscribe");
  if (!rate_Hz) return;
  choice.rate_Hz = *rate_Hz;
  outbox.choose(request.session, choice);
}

std::optional<double> Station::Impl::chosenRate(const Request& request, double wanted_Hz, double present_Hz,
                                                std::string_view call) {
  if (!std::isfinite(wanted_Hz) || wanted_Hz < 0) {
    sendText(
        request.session, request.name, wire::kTextError,
        fmt::format("{}: rate {} Hz refused: use 0 to keep the rate or a positive rate", call, wanted_Hz));
    return std::nullopt;
  }
  if (wanted_Hz == 0) return present_Hz;
  constexpr double kSlowest_Hz = 0.01;
  if (wanted_Hz < kSlowest_Hz) {
    sendText(request.session, request.name, wire::kTextWarning,
             fmt::format("{}: rate {} Hz is below the slowest, {} Hz, which is used instead", call, wanted_Hz,
                         kSlowest_Hz));
  }
  return std::clamp(wanted_Hz, kSlowest_Hz, config.servoRate_Hz);
}

// The pose of the proxy becomes the origin of the tracker reports, once the client's earlier commands have
// placed the world: a reset of the scene among them takes the origin away.
void Station::Impl::on(const Request& request, const wire::TrackerResetOrigin&) {
  whenApplied(request.session, [this](Session&) {
    const ClientTick clientTick = toClientTick(lastTickNow(), config.forceReport);
    frame.origin = clientTick.proxy;
    frame.rotation = clientTick.orientation;
  });
}

// The client's later orders of this kind may find its commands applied before this one has been called: it
// then comes first.
void Station::Impl::whenApplied(Session& session, std::function<void(Session&)> call) {
  const std::pair last(session.id(), ++waits);
  waiting.emplace(last, Waiting{&session, std::move(call)});
  asking = true;
  scene.whenApplied(session.id(), [this, last] {
    const auto known = waiting.find(last);
    if (known == waiting.end()) return;
    Session& client = *known->second.session;
    for (auto next = waiting.lower_bound({last.first, 0}); next != waiting.end() && next->first <= last;) {
      const auto node = waiting.extract(next++);
      if (!client.ending()) node.mapped().call(client);
    }
    if (!asking && !client.ending()) client.flush();  // otherwise at the end of what was read
  });
  asking = false;
}

// The newest scene places the world, which the servo may not have seen yet.
realtime::TickReport Station::Impl::lastTickNow() {
  realtime::TickReport last = outbox.last();
  if (!replayed) last.T_world_device = placement.read().T_world_device;
  return last;
}

void Station::Impl::on(const Request& request, const wire::ButtonAdmin& admin) {
  std::string error;
  if (!modes.setMode(admin, error)) sendText(request.session, request.name, wire::kTextError, error);
}

void Station::Impl::on(const Request& request, const wire::QueryCapabilities&) {
  request.session.send(request.name, capabilities(config, profile, !replayed, control.canBeHeld()));
  outbox.extend(request.session);
}

void Station::Impl::on(const Request& request, const wire::StopForces&) {
  if (replayed) {
    request.session.send(
        request.name,
        wire::Text{.severity = wire::kTextError,
                   .level = static_cast<std::uint32_t>(RefusalCode::notPermitted),
                   .text = "Stop_Forces refused: this server replays a recording, which has no force"});
    return;
  }
  request.session.logWarning(
      fmt::format("({}) stops the forces of '{}'", request.session.description(), config.names.front()));
  control.stopForces(request.order, request.sender);
}

void Station::Impl::on(const Request& request, const wire::RearmForces&) {
  // It would act before the commands of the batch, with forces that the batch ends, say.
  if (scene.batchOf(request.session.id()) == true) {
    sendText(request.session, request.name, wire::kTextError,
             "Rearm_Forces refused: a batch is open; commit it first");
    return;
  }
  const std::uint64_t number = ++rearms;
  pendingRearms.emplace(number, &request.session);
  scene.whenPublished(request.session.id(),
                      [this, number, name = request.name, order = request.order, sender = request.sender] {
                        const auto pending = pendingRearms.find(number);
                        if (pending == pendingRearms.end()) return;
                        Session& session = *pending->second;
                        if (session.peerGone() || session.ending()) return;  // clientGone() reports it
                        pendingRearms.erase(pending);
                        rearm(session, name, order, sender);
                      });
}

// Where forces are neither stopped nor latched, nothing is lost with it. A warning that does not name
// Rearm_Forces: it refuses nothing that the other clients sent.
std::optional<wire::Text> Station::Impl::dropRearms(Session& session) {
  const std::size_t dropped =
      std::erase_if(pendingRearms, [&](const auto& entry) { return entry.second == &session; });
  const std::set<wire::LocalSender>& unread = session.lostRearms();
  const bool any = dropped != 0 || std::any_of(names.begin(), names.end(), [&](const DeviceName& name) {
                     return unread.count(name.sender) != 0;
                   });
  if (!any || (!tick.control().stopped() && outbox.last().guard.latched == 0)) return std::nullopt;
  const std::string client = fmt::format("client {} ({})", session.id(), session.description());
  constexpr std::string_view kWhy = "its connection ended before its scene commands were in place";
  session.logWarning(
      fmt::format("({}) does not re-arm '{}': {}", session.description(), config.names.front(), kWhy));
  return wire::Text{.severity = wire::kTextWarning,
                    .level = 0,
                    .text = fmt::format("{} does not re-arm: {}", client, kWhy)};
}

// Called after the earlier commands of the client are published, so that they act from the first tick with
// force.
void Station::Impl::rearm(Session& session, wire::LocalSender name, const DeviceControl::Order& order,
                          const DeviceControl::Sender& sender) {
  Refusal refusal;
  const bool faults = outbox.last().guard.latched != 0;
  if (!control.rearmForces(order, sender, faults, refusal)) {
    const bool ignored = refusal.code == RefusalCode::none;
    session.send(name, wire::Text{.severity = ignored ? wire::kTextWarning : wire::kTextError,
                                  .level = static_cast<std::uint32_t>(refusal.code),
                                  .text = refusal.text});
    session.flush();
    return;
  }
  session.logWarning(fmt::format("({}, {}) re-armed the forces of '{}'", session.description(),
                                 nameOf(session.identity().role), config.names.front()));
  // With `calibrate` the operator consented to motion of the arm; the re-arm is the moment that a person
  // chose. Who may only undo its own stop moves no arm.
  if (sender.mayCommand && config.calibrate && (outbox.last().device.hold & device::kHoldNotCalibrated) != 0)
    keeper.calibrate();
}

void Station::Impl::on(const Request& request, const wire::ReleaseControl&) {
  // Its commit would change a scene that another client has.
  if (scene.batchOf(request.session.id()) == true) {
    sendText(request.session, request.name, wire::kTextError,
             "Release_Control refused: a batch is open; commit it first");
    return;
  }
  holding[request.session.id()].last = ++holds;
  control.letGo(request.session.id());
  roles->release(request.session.id());
}

// The pose is one of the world as the client has commanded it before.
void Station::Impl::on(const Request& request, const wire::HoldHand& wanted) {
  const scene::ClientId client = request.session.id();
  holding[client].session = &request.session;
  scene.whenApplied(client, [this, client, number = ++holds, name = request.name, wanted] {
    const auto known = holding.find(client);
    if (known == holding.end() || known->second.last > number || known->second.session->ending()) return;
    known->second.last = number;
    hold(*known->second.session, name, wanted);
  });
}

void Station::Impl::hold(Session& session, wire::LocalSender name, const wire::HoldHand& wanted) {
  Refusal refusal;
  if (control.hold(session.id(), wanted, placement.read().T_world_device, refusal)) return;
  session.send(name, wire::Text{.severity = wire::kTextError,
                                .level = static_cast<std::uint32_t>(refusal.code),
                                .text = refusal.text});
  session.flush();
}

template <class M>
void Station::Impl::onStreamed(const Request& request, const M& message) {
  const StreamedInput::Answer answer =
      streamed.on(request.session.id(), message, outbox.last(), request.order.received);
  if (answer.text.text.empty()) return;
  const bool refused = answer.text.code != RefusalCode::none;
  request.session.send(request.name, wire::Text{.severity = refused ? wire::kTextError : wire::kTextWarning,
                                                .level = static_cast<std::uint32_t>(answer.text.code),
                                                .text = answer.text.text});
}
template void Station::Impl::onStreamed(const Request&, const wire::RemoteContacts&);
template void Station::Impl::onStreamed(const Request&, const wire::HeldForce&);

void Station::onReset() {
  impl_->frame.origin.setZero();
  impl_->frame.rotation.setIdentity();
}

}  // namespace hapticd::server
