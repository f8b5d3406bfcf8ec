#include "server/reports/reporter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/time.h"
#include "server/reports/moving_objects.h"
#include "wire/codec.h"

namespace hapticd::server {
namespace {

using geometry::Quat;
using geometry::Vec3;
using realtime::TickReport;

constexpr double kForceStep_N = 1e-3;
constexpr double kDepthStep_m = 1e-5;
constexpr double kGripperStep_rad = 1e-3;
constexpr base::Nanos kTextPeriod = 1'000'000'000;

wire::F64x3 array(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

wire::F64x4 xyzw(const Quat& q) {
  return {q.x(), q.y(), q.z(), q.w()};
}

std::int16_t flag(bool value) {
  return value ? 1 : 0;
}

// Clamps are part of normal rendering; only trips that remove the force are reported as errors.
std::uint32_t forceRemovingTrips(const realtime::GuardReport& guard) {
  return (guard.active | guard.latched) & ~realtime::tripsOf(realtime::TripAction::clamp);
}

wire::GuardState guardState(const realtime::GuardReport& guard) {
  return {.active = guard.active & ~realtime::tripsOf(realtime::TripAction::clamp),
          .latched = guard.latched,
          .armed = flag(guard.armed),
          .stopped = flag(guard.stopped)};
}

wire::ContactList contactList(const TickReport& tick) {
  wire::ContactList list{.tick = tick.tick, .time = tick.time, .contacts = {}};
  if (!tick.rendering.touching) return list;  // adhesion pulls without a touch
  const geometry::Mat3 rotation = rotationOf(tick.T_world_device);
  for (std::uint32_t i = 0; i < tick.rendering.contactCount; ++i) {
    const realtime::Contact& contact = tick.rendering.contacts[i];
    auto& numbers = list.contacts.values;
    numbers.push_back(contact.object);
    for (const Vec3& v : {reported(tick, contact.point_m), Vec3(rotation * contact.normal),
                          Vec3(rotation * contact.force_N)}) {
      numbers.insert(numbers.end(), {v.x(), v.y(), v.z()});
    }
  }
  return list;
}

wire::HandState handState(const TickReport& tick, const ClientTick& clientTick, std::uint32_t buttons) {
  const realtime::RemoteRendering& remote = tick.remote;
  const geometry::Mat3 rotation = rotationOf(tick.T_world_device);
  wire::HandState state{.tick = tick.tick,
                        .time = tick.time,
                        .contactsTime = remote.contactsTime,
                        .forceTime = remote.forceTime,
                        .position = array(clientTick.hip),
                        .orientation = xyzw(clientTick.orientation),
                        .velocity = array(clientTick.velocity),
                        .angularVelocity = array(clientTick.angularVelocity),
                        .force = array(rotation * tick.force_N),
                        .heldForce = array(rotation * remote.heldForce_N),
                        .energy = remote.energy_J,
                        .gripper = clientTick.gripper_rad.value_or(0),
                        .buttons = buttons,
                        .flags = 0,
                        .guardActive = tick.guard.active,
                        .contacts = {}};
  if (clientTick.gripper_rad) state.flags |= wire::kHandHasGripper;
  if ((remote.status & realtime::kRemoteEnergySpent) != 0) state.flags |= wire::kHandEnergySpent;
  if ((remote.status & realtime::kRemoteCorrectionsHeld) != 0) state.flags |= wire::kHandCorrectionsHeld;
  for (std::uint32_t i = 0; i < remote.count; ++i) {
    const realtime::RemoteContactReport& contact = remote.contacts[i];
    const Vec3 proxy = reported(tick, contact.proxy_m.cast<double>());
    const Vec3 force = rotation * contact.force_N.cast<double>();
    state.contacts.values.insert(state.contacts.values.end(),
                                 {double(contact.id), proxy.x(), proxy.y(), proxy.z(), force.x(), force.y(),
                                  force.z(), contact.depth_m * clientTick.metre});
  }
  return state;
}

// The mirrors have fixed kinds: a client that addresses them by name need not know of subscriptions.
ReportChoice choiceFor(View view, ReportChoice choice) {
  switch (view) {
    case View::device:
      break;
    case View::hand:
      choice.kinds = wire::kReportHip;
      break;
    case View::contact:
      choice.kinds = wire::kReportContactPoint;
      break;
    case View::touch:
      choice.kinds = wire::kReportTouchButton | wire::kReportContactAnalog;
      break;
  }
  return choice;
}

}  // namespace

ReportChoice withMirrors(const DeviceConfig& config, ReportChoice choice) {
  if (!config.compatMirrors) return choice;
  if ((choice.kinds & wire::kReportTracker) != 0) {
    choice.kinds |= wire::kReportHip | wire::kReportContactPoint;
  }
  if ((choice.kinds & wire::kReportButton) != 0) choice.kinds |= wire::kReportTouchButton;
  if ((choice.kinds & wire::kReportAnalog) != 0) choice.kinds |= wire::kReportContactAnalog;
  return choice;
}

ReportChoice defaultChoice(const DeviceConfig& config) {
  return withMirrors(config, {.kinds = wire::kReportDefault, .rate_Hz = config.reportRate_Hz});
}

Reporter::Reporter(const DeviceConfig& config, int buttonCount, const ReportChoice& choice, View view)
    : config_(config),
      buttonCount_(view == View::device ? buttonCount : 0),
      view_(view),
      choice_(choiceFor(view, choice)),
      period_(base::toNanos(1.0 / choice.rate_Hz)),
      slack_(std::min(period_, base::toNanos(1.0 / config.servoRate_Hz)) / 2) {}

wire::F64x4 Reporter::quaternion(const Quat& q) const {
  if (config_.quaternionOrder == QuaternionOrder::wxyz) return {q.w(), q.x(), q.y(), q.z()};
  return xyzw(q);
}

void Reporter::update(const TickReport& tick, const ReportFrame& frame, std::vector<Outgoing>& out) {
  guard(tick, out);
  const bool touching = tick.rendering.touching;
  buttons(frame.buttons, touching, out);
  const bool contactEnded = touching_ && !touching;
  const bool contactChanged = touching_ != touching;
  const bool inBetween = tick.time < due_;
  if (!inBetween) {
    // The first tick begins the intervals. A later one may be early by half a servo period and still be due.
    const base::Nanos due = due_ == 0 ? tick.time - slack_ : due_;
    due_ = std::max(due + period_, tick.time - period_ / 2);
  } else if (!contactChanged) {
    return;
  }
  now_ = tick.time;
  const std::size_t first = out.size();
  const ClientTick clientTick = toClientTick(tick, config_.forceReport);
  tracker(clientTick, frame, out);
  if (contactEnded) {
    contactEnd(clientTick, out);
  } else {
    bool changed = contact(clientTick, out) && wants(wire::kReportContactAnalog);
    changed |= gripperMoved(clientTick);
    if (changed) analogChange_.changed(now_);
    if (changed || analogChange_.settles(now_)) analog(clientTick, !changed, out);
  }
  touching_ = clientTick.touching;
  if (wants(wire::kReportForce)) out.push_back({wire::IsTouching{flag(clientTick.touching)}, contactChanged});
  poses(tick, frame, out);
  tickReport(tick, clientTick, contactEnded, out);
  // The end of the contact, which is reliable, may be next: a datagram from before could arrive after it.
  for (std::size_t i = first; inBetween && i < out.size(); ++i) out[i].reliable = true;
}

void Reporter::skip(const TickReport& tick, const ReportFrame& frame, std::vector<Outgoing>& out) {
  if (touching_ != tick.rendering.touching) {
    update(tick, frame, out);
    return;
  }
  guard(tick, out);
  buttons(frame.buttons, tick.rendering.touching, out);
  if (tick.time >= due_) ++skipped_;
}

void Reporter::guard(const TickReport& tick, std::vector<Outgoing>& out) {
  if (view_ != View::device) return;
  const wire::GuardState state = guardState(tick.guard);
  if (!(state == guard_)) out.push_back({guard_ = state, true});
  constexpr std::uint32_t kInside = realtime::bit(realtime::Trip::deepContact);
  const bool inside = (tick.guard.active & kInside) != 0;
  if (inside && !inside_ && tick.time >= insideTextDue_) {
    const realtime::TripInfo& trip = realtime::kTrips[static_cast<std::size_t>(realtime::Trip::deepContact)];
    out.push_back({wire::Text{.severity = wire::kTextWarning,
                              .level = 0,
                              .text = std::string(trip.what) + " " + std::string(trip.remedy)},
                   true});
    insideTextDue_ = tick.time + kTextPeriod;
  }
  inside_ = inside;
  const std::uint32_t now = forceRemovingTrips(tick.guard);
  if (now == reportedTrips_) return;
  for (const realtime::TripInfo& trip : realtime::kTrips) {
    if ((now & ~reportedTrips_ & realtime::bit(trip.trip)) != 0) {
      out.push_back({wire::ForceError{static_cast<std::int32_t>(trip.forceError)}, true});
    }
  }
  if (now == 0)
    out.push_back({wire::ForceError{static_cast<std::int32_t>(realtime::ForceError::recovered)}, true});
  reportedTrips_ = now;
}

wire::ButtonStates Reporter::buttonStates(std::uint32_t buttons, bool touching) const {
  wire::ButtonStates states;
  for (int i = 0; i < buttonCount_; ++i) {
    states.states.values.push_back(static_cast<std::int32_t>(buttons >> i & 1U));
  }
  if (wants(wire::kReportTouchButton)) states.states.values.push_back(touching ? 1 : 0);
  return states;
}

std::int32_t Reporter::sensorCount() const noexcept {
  if (view_ != View::device) return 1;
  return wants(wire::kReportContactPoint) ? kSensorContact + 1 : wants(wire::kReportHip) ? kSensorHip + 1 : 1;
}

void Reporter::buttons(std::uint32_t buttons, bool touching, std::vector<Outgoing>& out) {
  const std::uint32_t changed = buttons ^ std::exchange(buttons_, buttons);
  const bool touchChanged = touching != std::exchange(touchButton_, touching);
  if (wants(wire::kReportButton)) {
    for (std::int32_t i = 0; i < buttonCount_; ++i) {
      if ((changed >> i & 1U) == 0) continue;
      out.push_back({wire::ButtonChange{i, static_cast<std::int32_t>(buttons >> i & 1U)}, true});
    }
  }
  if (touchChanged && wants(wire::kReportTouchButton)) {
    out.push_back({wire::ButtonChange{buttonCount_, touching ? 1 : 0}, true});
  }
}

bool Reporter::moved(std::int32_t sensor, const Vec3& position, const Quat& orientation, double metre) {
  Sent& sent = sensors_[static_cast<std::size_t>(sensor)];
  const bool far = !((position - sent.position).norm() <= config_.linearTolerance_m * metre);
  if (!far && config_.linearTolerance_m > 0 &&
      sent.orientation.angularDistance(orientation) <= config_.angularTolerance_rad) {
    return false;
  }
  sent.position = position;
  sent.orientation = orientation;
  sent.last.changed(now_);
  return true;
}

void Reporter::tracker(const ClientTick& clientTick, const ReportFrame& frame, std::vector<Outgoing>& out) {
  constexpr std::uint32_t kAny = wire::kReportTracker | wire::kReportHip | wire::kReportContactPoint;
  if (!wants(kAny)) return;
  const Quat toFrame = frame.rotation.conjugate();
  const Quat orientation = toFrame * clientTick.orientation;
  const auto pose = [&](std::uint32_t kind, std::int32_t sensor, const Vec3& world) {
    const Vec3 position = toFrame * (world - frame.origin);
    const bool changed = moved(sensor, position, orientation, clientTick.metre);
    if (!changed && !sensors_[static_cast<std::size_t>(sensor)].last.settles(now_)) return false;
    if (!wants(kind)) return changed;
    const std::int32_t number = view_ == View::device ? sensor : 0;
    out.push_back({wire::TrackerPosQuat{.sensor = number,
                                        .filler = number,
                                        .position = array(position),
                                        .orientation = quaternion(orientation)},
                   !changed});
    return changed;
  };
  pose(wire::kReportTracker, kSensorProxy, clientTick.proxy);
  // A client without sensor 1 gets the velocity of the HIP as that of sensor 0, as from a stock server.
  if (pose(wire::kReportHip, kSensorHip, clientTick.hip) && wants(wire::kReportTracker | wire::kReportHip)) {
    const bool separate = view_ == View::device && wants(wire::kReportHip);
    velocity(clientTick, toFrame, separate ? kSensorHip : kSensorProxy, out);
  }
  if (clientTick.touching) pose(wire::kReportContactPoint, kSensorContact, clientTick.scp);
}

void Reporter::velocity(const ClientTick& clientTick, const Quat& toFrame, std::int32_t sensor,
                        std::vector<Outgoing>& out) const {
  // VRPN encodes angular velocity as the rotation during an interval.
  constexpr double kInterval_s = 0.01;
  const Vec3 angular = toFrame * clientTick.angularVelocity;
  const double angle = angular.norm() * kInterval_s;
  const Quat turn = angle > 0 ? Quat(Eigen::AngleAxisd(angle, angular.normalized())) : Quat::Identity();
  out.push_back({wire::TrackerVelocity{.sensor = sensor,
                                       .filler = sensor,
                                       .velocity = array(toFrame * clientTick.velocity),
                                       .rotation = quaternion(turn),
                                       .interval = kInterval_s},
                 false});
}

bool Reporter::gripperMoved(const ClientTick& clientTick) const {
  if (!clientTick.gripper_rad) return false;
  return !gripper_rad_ || std::abs(*clientTick.gripper_rad - *gripper_rad_) > kGripperStep_rad;
}

// Appends the changes of force and contact; true when any of them changed.
bool Reporter::contact(const ClientTick& clientTick, std::vector<Outgoing>& out) {
  const std::size_t before = out.size();
  // Always report the transition to exactly zero force, even below the threshold.
  const bool ended = clientTick.force_N.isZero(0) && !force_N_.isZero(0);
  const auto report = [&](bool changed, LastChange& last, const auto& message) {
    if (changed) last.changed(now_);
    if (changed || last.settles(now_)) out.push_back({message, !changed});
    return changed;
  };
  const bool pushed = ended || (clientTick.force_N - force_N_).norm() > kForceStep_N;
  if (pushed) force_N_ = clientTick.force_N;
  const bool sunk = std::abs(clientTick.depth - depth_) > kDepthStep_m * clientTick.metre;
  if (sunk) depth_ = clientTick.depth;
  const bool other = std::exchange(object_, clientTick.object) != clientTick.object;
  bool changed = report(pushed, forceChange_, wire::Force{array(clientTick.force_N)});
  changed |= report(sunk, depthChange_, wire::Dop{clientTick.depth});
  changed |= report(other, objectChange_, wire::TouchedObject{clientTick.object});
  if (clientTick.touching) {
    const bool turned = std::exchange(angle_deg_, clientTick.angle_deg) != clientTick.angle_deg || !touching_;
    changed |= report(turned, angleChange_, wire::Angle{clientTick.angle_deg, 1});
    const bool moved = scp_ != clientTick.scp;
    scp_ = clientTick.scp;
    report(moved, scpChange_, wire::Scp{array(clientTick.scp), quaternion(clientTick.orientation)});
  }
  if (!wants(wire::kReportForce)) out.erase(out.begin() + static_cast<std::ptrdiff_t>(before), out.end());
  return changed;
}

// Send end-of-contact reports reliably; a lost datagram would leave the client in contact.
void Reporter::contactEnd(const ClientTick& clientTick, std::vector<Outgoing>& out) {
  force_N_ = clientTick.force_N;
  depth_ = 0;
  object_ = -1;
  angle_deg_ = 0;
  scp_ = Vec3::Constant(1e300);
  analog(clientTick, true, out);
  if (!wants(wire::kReportForce)) return;
  out.push_back({wire::Force{array(clientTick.force_N)}, true});
  out.push_back({wire::Dop{0}, true});
  out.push_back({wire::TouchedObject{-1}, true});
  out.push_back({wire::Angle{0, 0}, true});
}

void Reporter::analog(const ClientTick& clientTick, bool reliable, std::vector<Outgoing>& out) {
  gripper_rad_ = clientTick.gripper_rad;
  const bool mirrored = wants(wire::kReportContactAnalog);
  if (!mirrored && !(wants(wire::kReportAnalog) && clientTick.gripper_rad)) return;
  const Vec3& f = clientTick.force_N;
  wire::AnalogChannels channels;
  if (mirrored) {
    channels.channels.values = {
        f.x(), f.y(), f.z(), clientTick.depth, clientTick.angle_deg, double(clientTick.object)};
  }
  if (clientTick.gripper_rad) channels.channels.values.push_back(*clientTick.gripper_rad);
  out.push_back({std::move(channels), reliable});
}

void Reporter::tickReport(const TickReport& tick, const ClientTick& clientTick, bool contactEnded,
                          std::vector<Outgoing>& out) {
  if (wants(wire::kReportTick)) {
    out.push_back({wire::TickReport{.tick = tick.tick,
                                    .time = tick.time,
                                    .revision = tick.revision,
                                    .hand = array(clientTick.hip),
                                    .proxy = array(clientTick.proxy),
                                    .velocity = array(clientTick.velocity),
                                    .orientation = xyzw(clientTick.orientation),
                                    .force = array(clientTick.force_N),
                                    .depth = clientTick.depth,
                                    .object = clientTick.object,
                                    .buttons = buttons_,
                                    .guardActive = tick.guard.active,
                                    .guardLatched = tick.guard.latched},
                   false});
  }
  if (wants(wire::kReportHand)) {
    const std::uint32_t own = buttonCount_ < 32 ? ~(1U << buttonCount_) : ~0U;
    out.push_back({handState(tick, clientTick, buttons_ & own), false});
  }
  if (wants(wire::kReportContacts) && (clientTick.touching || contactEnded))
    out.push_back({contactList(tick), contactEnded});
}

// Before the tick, so that a picture of the tick has its poses.
void Reporter::poses(const TickReport& tick, const ReportFrame& frame, std::vector<Outgoing>& out) {
  if (!wants(wire::kReportPoses) || frame.moving == nullptr || view_ != View::device) return;
  wire::Poses message{.tick = tick.tick, .time = tick.time, .poses = {}};
  frame.moving->append(tick.time, wire::Poses::kMost, nextPose_, message.poses.values);
  if (!message.poses.values.empty()) out.push_back({std::move(message), false});
}

void Reporter::presentState(const TickReport& tick, const ReportFrame& frame, bool touchButton,
                            std::vector<Outgoing>& out) const {
  Reporter fresh(config_, buttonCount_, choice_, view_);
  const bool touching = tick.rendering.touching;
  fresh.touching_ = !touching;  // makes update() report the whole contact state
  fresh.force_N_ = Vec3::Constant(1e300);
  fresh.depth_ = 1e300;
  fresh.object_ = -2;
  fresh.guard_.armed = -1;
  if (wants(wire::kReportButton | wire::kReportTouchButton)) {
    out.push_back({buttonStates(frame.buttons, touchButton), true});
  }
  fresh.nextPose_ = nextPose_;
  fresh.buttons_ = frame.buttons;
  fresh.touchButton_ = touching;
  fresh.update(tick, frame, out);
  for (Outgoing& message : out) message.reliable = true;
}

}  // namespace hapticd::server
