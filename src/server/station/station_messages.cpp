// What a client says to a device itself: questions, choices, control.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "server/station/answers.h"
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
  if (impl_->played) {
    reason = "this server replays a recording, which nobody can change";
    return false;
  }
  Roles& roles = impl_->roles;
  if (roles.mayCommand(session.id(), session.address())) return true;
  reason = roles.reason();
  return false;
}

void Station::onMessage(Session& session, const wire::MessageReceived& message) {
  // A report that a client sends does nothing; a malformed one is refused like every other message.
  std::string error;
  if (wire::role(message.kind) == wire::Role::control) {
    const auto handle = [&](const auto& m) { impl_->on(session, message.local_sender, m); };
    const auto handled = wire::dispatchControl(message.kind, message.payload, handle);
    if (!handled) error = handled.error();
  } else if (const auto decoded = wire::decode(message.kind, message.payload); !decoded) {
    error = decoded.error();
  }
  if (!error.empty()) session.refuse("malformed message: " + error);
}

void Station::Impl::on(Session& session, wire::LocalSender name, const wire::Ping&) {
  const realtime::TickReport& last = outbox.last();
  session.send(name, wire::Pong{});
  session.send(name, Reporter::buttonStates(profile.buttons, frame.buttons, last.rendering.touching));
}

void Station::Impl::on(Session& session, wire::LocalSender, const wire::Text& text) {
  session.remark("says " + wire::inQuotes(text.text.text));
}

void Station::Impl::on(Session& session, wire::LocalSender name, const wire::TrackerRequestToRoom&) {
  session.send(name, trackerToRoom(frame));
}

void Station::Impl::on(Session& session, wire::LocalSender name, const wire::TrackerRequestUnitToSensor&) {
  for (std::int32_t sensor = 0; sensor < kSensors; ++sensor) {
    session.send(name, wire::TrackerUnitToSensor{
                           .sensor = sensor, .filler = 0, .position = {}, .orientation = {0, 0, 0, 1}});
  }
}

void Station::Impl::on(Session& session, wire::LocalSender name, const wire::TrackerRequestWorkspace&) {
  session.send(name, trackerWorkspace(workspaceOf(config, profile), outbox.last()));
}

void Station::Impl::on(Session& session, wire::LocalSender name, const wire::TrackerSetUpdateRate& wanted) {
  choose(session, name, outbox.choiceOf(session.id()), wanted.rate, "set_update_rate");
}

void Station::Impl::on(Session& session, wire::LocalSender name, const wire::Subscribe& wanted) {
  ReportChoice choice = outbox.choiceOf(session.id());
  choice.kinds = wanted.kinds & wire::kReportAll;
  choose(session, name, choice, wanted.rate, "Subscribe");
}

void Station::Impl::choose(Session& session, wire::LocalSender name, ReportChoice choice, double rate_Hz,
                           std::string_view call) {
  if (!std::isfinite(rate_Hz) || rate_Hz < 0) {
    sendText(session, name, wire::kTextError,
             fmt::format("{}: rate {} Hz refused: 0 keeps the rate, a positive one sets it", call, rate_Hz));
    return;
  }
  constexpr double kSlowest_Hz = 0.01;
  if (rate_Hz > 0) choice.rate_Hz = std::clamp(rate_Hz, kSlowest_Hz, config.servoRate_Hz);
  outbox.choose(session, choice);
}

// From now on the tracker's poses count from where the proxy is.
void Station::Impl::on(Session&, wire::LocalSender, const wire::TrackerResetOrigin&) {
  const View view = viewOf(outbox.last(), config.forceReport);
  frame.origin = view.proxy;
  frame.turn = view.orientation;
}

void Station::Impl::on(Session& session, wire::LocalSender name, const wire::ButtonAdmin& admin) {
  std::string error;
  if (!modes.obey(admin, alerts, error)) sendText(session, name, wire::kTextError, error);
}

void Station::Impl::on(Session& session, wire::LocalSender name, const wire::QueryCapabilities&) {
  session.send(name, capabilities(config, profile, control.canBeHeld()));
}

void Station::Impl::on(Session& session, wire::LocalSender, const wire::StopForces&) {
  spdlog::warn("client {} ({}) stops the forces of '{}'", session.id(), session.description(),
               config.names.front());
  control.stopForces();
}

void Station::Impl::on(Session& session, wire::LocalSender, const wire::RearmForces&) {
  spdlog::warn("client {} ({}) re-arms the forces of '{}'", session.id(), session.description(),
               config.names.front());
  control.rearmForces();
  // The operator consented to motion at the start; this is the moment that a person chose.
  if (config.calibrate && (outbox.last().device.hold & device::kHoldNotCalibrated) != 0) keeper.calibrate();
}

void Station::Impl::on(Session& session, wire::LocalSender name, const wire::HoldHand& wanted) {
  std::string error;
  if (!control.hold(session.id(), wanted, outbox.last(), error))
    sendText(session, name, wire::kTextError, error);
}

void Station::onReset() {
  impl_->control.rampIn();  // what is felt after it comes in gently
  impl_->frame.origin.setZero();
  impl_->frame.turn.setIdentity();
}

}  // namespace hapticd::server
