#include "server/reports/reporter.h"

#include <algorithm>
#include <cmath>

#include "base/time.h"
#include "wire/codec.h"

namespace hapticd::server {
namespace {

using geometry::Quat;
using geometry::Vec3;
using realtime::TickReport;

constexpr double kForceStep_N = 1e-3;
constexpr double kDepthStep_m = 1e-5;
constexpr double kGripperStep_rad = 1e-3;

wire::F64x3 array(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

wire::F64x4 xyzw(const Quat& q) {
  return {q.x(), q.y(), q.z(), q.w()};
}

std::int16_t flag(bool value) {
  return value ? 1 : 0;
}

// What clamps the force is part of normal rendering; what takes it away is told.
std::uint32_t tripped(const realtime::GuardReport& guard) {
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
  const geometry::Mat3 rotation = rotationOf(tick);
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

}  // namespace

Reporter::Reporter(const DeviceConfig& config, int buttonCount, const ReportChoice& choice)
    : config_(config),
      buttonCount_(buttonCount),
      choice_(choice),
      period_(base::toNanos(1.0 / choice.rate_Hz)) {}

wire::F64x4 Reporter::quaternion(const Quat& q) const {
  if (config_.quaternionOrder == QuaternionOrder::wxyz) return {q.w(), q.x(), q.y(), q.z()};
  return xyzw(q);
}

void Reporter::update(const TickReport& tick, const ReportFrame& frame, std::vector<Outgoing>& out) {
  guard(tick, out);
  const bool touching = tick.rendering.touching;
  buttons(frame.buttons | std::uint32_t{touching} << buttonCount_, out);
  const bool over = touching_ && !touching;
  if (tick.time < due_ && !over) return;
  due_ = std::max(due_ + period_, tick.time - period_ / 2);
  const View view = viewOf(tick, config_.forceReport);
  tracker(view, frame, out);
  if (over) {
    contactEnd(view, out);
  } else if (const bool changed = contact(view, out); gripped(view) || changed) {
    analog(view, false, out);
  }
  touching_ = view.touching;
  if (wants(wire::kReportForce)) out.push_back({wire::IsTouching{flag(view.touching)}, false});
  wholeTick(tick, view, over, out);
}

void Reporter::guard(const TickReport& tick, std::vector<Outgoing>& out) {
  const wire::GuardState state = guardState(tick.guard);
  if (!(state == guard_)) out.push_back({guard_ = state, true});
  const std::uint32_t now = tripped(tick.guard);
  if (now == tripped_) return;
  for (const realtime::TripInfo& trip : realtime::kTrips) {
    if ((now & ~tripped_ & realtime::bit(trip.trip)) != 0) {
      out.push_back({wire::ForceError{static_cast<std::int32_t>(trip.forceError)}, true});
    }
  }
  if (now == 0) out.push_back({wire::ForceError{static_cast<std::int32_t>(realtime::ForceError::recovered)}, true});
  tripped_ = now;
}

wire::ButtonStates Reporter::buttonStates(int buttonCount, std::uint32_t buttons, bool touching) {
  wire::ButtonStates states;
  for (int i = 0; i < buttonCount; ++i) {
    states.states.values.push_back(static_cast<std::int32_t>(buttons >> i & 1U));
  }
  states.states.values.push_back(touching ? 1 : 0);
  return states;
}

void Reporter::buttons(std::uint32_t buttons, std::vector<Outgoing>& out) {
  const std::uint32_t changed = buttons ^ buttons_;
  buttons_ = buttons;
  if (!wants(wire::kReportButton)) return;
  for (std::int32_t i = 0; i < 32; ++i) {
    if ((changed >> i & 1U) == 0) continue;
    out.push_back({wire::ButtonChange{i, static_cast<std::int32_t>(buttons >> i & 1U)}, true});
  }
}

bool Reporter::moved(std::int32_t sensor, const Vec3& position, const Quat& orientation) {
  Sent& sent = sensors_[static_cast<std::size_t>(sensor)];
  const bool far = !((position - sent.position).norm() <= config_.linearTolerance_m);
  if (!far && config_.linearTolerance_m > 0 &&
      sent.orientation.angularDistance(orientation) <= config_.angularTolerance_rad) {
    return false;
  }
  sent = {position, orientation};
  return true;
}

void Reporter::tracker(const View& view, const ReportFrame& frame, std::vector<Outgoing>& out) {
  if (!wants(wire::kReportTracker)) return;
  const Quat back = frame.turn.conjugate();
  const Quat orientation = back * view.orientation;
  const auto report = [&](std::int32_t sensor, const Vec3& world) {
    const Vec3 position = back * (world - frame.origin);
    if (!moved(sensor, position, orientation)) return;
    out.push_back({wire::TrackerPosQuat{.sensor = sensor,
                                        .filler = sensor,
                                        .position = array(position),
                                        .orientation = quaternion(orientation)},
                   false});
    if (sensor != kSensorHip) return;
    // VRPN gives angular velocity as the rotation during an interval.
    constexpr double kInterval_s = 0.01;
    const Vec3 angular = back * view.angularVelocity;
    const double angle = angular.norm() * kInterval_s;
    const Quat turn = angle > 0 ? Quat(Eigen::AngleAxisd(angle, angular.normalized())) : Quat::Identity();
    out.push_back({wire::TrackerVelocity{.sensor = sensor,
                                         .filler = sensor,
                                         .velocity = array(back * view.velocity),
                                         .rotation = quaternion(turn),
                                         .interval = kInterval_s},
                   false});
  };
  report(kSensorProxy, view.proxy);
  report(kSensorHip, view.hip);
  if (view.touching) report(kSensorContact, view.scp);
}

bool Reporter::gripped(const View& view) const {
  if (!view.gripper_rad) return false;
  return !gripper_rad_ || std::abs(*view.gripper_rad - *gripper_rad_) > kGripperStep_rad;
}

// True when something of it has changed.
bool Reporter::contact(const View& view, std::vector<Outgoing>& out) {
  const std::size_t before = out.size();
  // Nothing is said to be nothing, however small the rest before.
  const bool ended = view.force_N.isZero(0) && !force_N_.isZero(0);
  if (ended || (view.force_N - force_N_).norm() > kForceStep_N) {
    force_N_ = view.force_N;
    out.push_back({wire::Force{array(view.force_N)}, false});
  }
  if (std::abs(view.depth - depth_) > kDepthStep_m) {
    depth_ = view.depth;
    out.push_back({wire::Dop{view.depth}, false});
  }
  if (view.object != object_) {
    object_ = view.object;
    out.push_back({wire::TouchedObject{view.object}, false});
  }
  if (view.touching && (view.angle_deg != angle_deg_ || !touching_)) {
    angle_deg_ = view.angle_deg;
    out.push_back({wire::Angle{view.angle_deg, 1}, false});
  }
  const bool changed = out.size() > before;
  if (view.touching && view.scp != scp_) {
    scp_ = view.scp;
    out.push_back({wire::Scp{array(view.scp), quaternion(view.orientation)}, false});
  }
  if (!wants(wire::kReportForce)) out.erase(out.begin() + static_cast<std::ptrdiff_t>(before), out.end());
  return changed;
}

// The last words of a contact must arrive, or a client would believe in it for ever.
void Reporter::contactEnd(const View& view, std::vector<Outgoing>& out) {
  force_N_ = view.force_N;
  depth_ = 0;
  object_ = -1;
  angle_deg_ = 0;
  scp_ = Vec3::Constant(1e300);
  analog(view, true, out);
  if (!wants(wire::kReportForce)) return;
  out.push_back({wire::Force{array(view.force_N)}, true});
  out.push_back({wire::Dop{0}, true});
  out.push_back({wire::TouchedObject{-1}, true});
  out.push_back({wire::Angle{0, 0}, true});
}

void Reporter::analog(const View& view, bool reliable, std::vector<Outgoing>& out) {
  gripper_rad_ = view.gripper_rad;
  if (!wants(wire::kReportAnalog)) return;
  const Vec3& f = view.force_N;
  wire::AnalogChannels channels;
  channels.channels.values = {f.x(),          f.y(), f.z(), view.depth, view.angle_deg,
                              double(view.object)};
  if (view.gripper_rad) channels.channels.values.push_back(*view.gripper_rad);
  out.push_back({std::move(channels), reliable});
}

void Reporter::wholeTick(const TickReport& tick, const View& view, bool over, std::vector<Outgoing>& out) {
  if (wants(wire::kReportTick)) {
    out.push_back({wire::TickReport{.tick = tick.tick,
                                    .time = tick.time,
                                    .revision = tick.revision,
                                    .hand = array(view.hip),
                                    .proxy = array(view.proxy),
                                    .velocity = array(view.velocity),
                                    .orientation = xyzw(view.orientation),
                                    .force = array(view.force_N),
                                    .depth = view.depth,
                                    .object = view.object,
                                    .buttons = buttons_ & ~(1U << buttonCount_),
                                    .guard_active = tick.guard.active,
                                    .guard_latched = tick.guard.latched},
                   false});
  }
  if (wants(wire::kReportContacts) && (view.touching || over)) out.push_back({contactList(tick), over});
}

void Reporter::presentState(const TickReport& tick, const ReportFrame& frame,
                            std::vector<Outgoing>& out) const {
  Reporter fresh(config_, buttonCount_, choice_);
  const bool touching = tick.rendering.touching;
  fresh.touching_ = !touching;  // so that either kind of contact state is said in full
  fresh.force_N_ = Vec3::Constant(1e300);
  fresh.depth_ = 1e300;
  fresh.object_ = -2;
  fresh.guard_.armed = -1;
  if (wants(wire::kReportButton)) out.push_back({buttonStates(buttonCount_, frame.buttons, touching), true});
  fresh.buttons_ = frame.buttons | std::uint32_t{touching} << buttonCount_;
  fresh.update(tick, frame, out);
  for (Outgoing& message : out) message.reliable = true;
}

}  // namespace hapticd::server
