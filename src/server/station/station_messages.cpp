// Control messages of clients: queries, subscriptions, stop, re-arm and steering.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

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

bool Station::mayCommand(const Session& session, std::string& reason) {
  if (impl_->replayed) {
    reason = "this server replays a recording, which cannot be changed";
    return false;
  }
  Roles& roles = impl_->roles;
  if (roles.mayCommand(session.id(), session.address())) return true;
  reason = roles.reason();
  return false;
}

void Station::onControl(Session& session, const wire::MessageReceived& message, base::Nanos received) {
  const base::Nanos sent =
      message.time.seconds * base::Nanos{1'000'000'000} + message.time.microseconds * base::Nanos{1000};
  const Request request{session, message.local_sender, {received, sent, session.address()}};
  const auto handled = wire::dispatchControl(message.kind, message.payload,
                                             [&](const auto& control) { impl_->on(request, control); });
  if (!handled) session.refuse("malformed message: " + handled.error());
}

void Station::Impl::on(const Request& request, const wire::Ping&) {
  const realtime::TickReport& last = outbox.last();
  request.session.send(request.name, wire::Pong{});
  request.session.send(request.name,
                       Reporter::buttonStates(profile.buttons, frame.buttons, last.rendering.touching));
}

void Station::Impl::on(const Request& request, const wire::Text& text) {
  request.session.logWarning("sent the text " + wire::inQuotes(text.text.text));
}

void Station::Impl::on(const Request& request, const wire::TrackerRequestToRoom&) {
  request.session.send(request.name, trackerToRoom(frame));
}

void Station::Impl::on(const Request& request, const wire::TrackerRequestUnitToSensor&) {
  for (std::int32_t sensor = 0; sensor < kSensorCount; ++sensor) {
    request.session.send(request.name,
                         wire::TrackerUnitToSensor{
                             .sensor = sensor, .filler = 0, .position = {}, .orientation = {0, 0, 0, 1}});
  }
}

void Station::Impl::on(const Request& request, const wire::TrackerRequestWorkspace&) {
  request.session.send(request.name, trackerWorkspace(workspaceOf(config, profile), outbox.last()));
}

void Station::Impl::on(const Request& request, const wire::TrackerSetUpdateRate& wanted) {
  choose(request.session, request.name, outbox.choiceOf(request.session.id()), wanted.rate,
         "set_update_rate");
}

void Station::Impl::on(const Request& request, const wire::Subscribe& wanted) {
  ReportChoice choice = outbox.choiceOf(request.session.id());
  choice.kinds = wanted.kinds & wire::kReportAll;
  choose(request.session, request.name, choice, wanted.rate, "Subscribe");
}

void Station::Impl::choose(Session& session, wire::LocalSender name, ReportChoice choice, double rate_Hz,
                           std::string_view call) {
  if (!std::isfinite(rate_Hz) || rate_Hz < 0) {
    sendText(session, name, wire::kTextError,
             fmt::format("{}: rate {} Hz refused: use 0 to keep the rate or a positive rate", call, rate_Hz));
    return;
  }
  constexpr double kSlowest_Hz = 0.01;
  if (rate_Hz > 0) choice.rate_Hz = std::clamp(rate_Hz, kSlowest_Hz, config.servoRate_Hz);
  outbox.choose(session, choice);
}

// The pose of the proxy becomes the origin of the tracker reports.
void Station::Impl::on(const Request&, const wire::TrackerResetOrigin&) {
  const ClientTick clientTick = toClientTick(outbox.last(), config.forceReport);
  frame.origin = clientTick.proxy;
  frame.rotation = clientTick.orientation;
}

void Station::Impl::on(const Request& request, const wire::ButtonAdmin& admin) {
  std::string error;
  if (!modes.setMode(admin, alerts, error)) sendText(request.session, request.name, wire::kTextError, error);
}

void Station::Impl::on(const Request& request, const wire::QueryCapabilities&) {
  request.session.send(request.name, capabilities(config, profile, control.canBeHeld()));
}

void Station::Impl::on(const Request& request, const wire::StopForces&) {
  request.session.logWarning(
      fmt::format("({}) stops the forces of '{}'", request.session.description(), config.names.front()));
  control.stopForces(request.order);
}

void Station::Impl::on(const Request& request, const wire::RearmForces&) {
  request.session.logWarning(
      fmt::format("({}) re-arms the forces of '{}'", request.session.description(), config.names.front()));
  pendingRearms.insert(&request.session);
  scene.whenPublished(request.session.id(),
                      [this, session = &request.session, name = request.name, order = request.order] {
                        if (pendingRearms.count(session) != 0) rearm(*session, name, order);
                      });
}

// Called after the earlier commands of the client are published, so that they act from the first tick with
// force.
void Station::Impl::rearm(Session& session, wire::LocalSender name, const DeviceControl::Order& order) {
  if (!control.rearmForces(order)) {
    sendText(session, name, wire::kTextWarning,
             "Rearm_Forces ignored: the forces were stopped after it was sent");
    session.flush();
    return;
  }
  // With `calibrate` the operator consented to motion of the arm; the re-arm is the moment that a person
  // chose.
  if (config.calibrate && (outbox.last().device.hold & device::kHoldNotCalibrated) != 0) keeper.calibrate();
}

void Station::Impl::on(const Request& request, const wire::HoldHand& wanted) {
  Refusal refusal;
  if (control.hold(request.session.id(), wanted, outbox.last(), refusal)) return;
  request.session.send(request.name, wire::Text{.severity = wire::kTextError,
                                                .level = static_cast<std::uint32_t>(refusal.code),
                                                .text = refusal.text});
}

void Station::onReset() {
  impl_->control.rampIn();
  impl_->frame.origin.setZero();
  impl_->frame.rotation.setIdentity();
}

}  // namespace hapticd::server
