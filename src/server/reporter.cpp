#include "server/reporter.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace hapticd::server {
namespace {

using geometry::Mat3;
using geometry::Quat;
using geometry::Vec3;

constexpr double kForceStep_N = 1e-3;
constexpr double kDepthStep_m = 1e-5;
constexpr double kWorldPerReported = 1000;  // the paper's rule: metres when the world is in millimetres

wire::F64x3 array(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

std::int16_t flag(bool value) {
  return value ? 1 : 0;
}

}  // namespace

struct Reporter::View {
  Vec3 proxy, hip, scp, velocity, force_N;
  Quat orientation;
  Vec3 angularVelocity;
  bool touching = false;
  std::int32_t object = -1;
  double depth = 0;
  double angle_deg = 0;
};

Reporter::Reporter(const DeviceConfig& config, int buttonCount, double rate_Hz)
    : config_(config), buttonCount_(buttonCount), period_(geometry::toNanos(1.0 / rate_Hz)) {}

Reporter::View Reporter::viewOf(const realtime::TickReport& tick) const {
  const geometry::Affine& T = tick.T_world_device;
  const Mat3 linear = T.linear();
  const double scale = std::cbrt(std::abs(linear.determinant()));
  const Mat3 rotation = linear / scale;
  const realtime::Rendering& felt = tick.rendering;

  View view;
  view.proxy = T * felt.proxy_m / kWorldPerReported;
  view.hip = T * tick.device.position_m / kWorldPerReported;
  view.scp = T * felt.scp_m / kWorldPerReported;
  view.velocity = linear * tick.device.velocity_m_per_s / kWorldPerReported;
  view.angularVelocity = rotation * tick.device.angularVelocity_rad_per_s;
  view.orientation = (Quat(rotation) * tick.device.orientation).normalized();
  view.force_N = rotation * (config_.forceReport == ForceReport::normal ? felt.normalForce_N : tick.force_N);
  view.touching = felt.touching;
  view.object = felt.touching ? felt.touchedObject : -1;
  view.depth = felt.touching ? felt.depth_m * scale / kWorldPerReported : 0;
  if (felt.touching) {
    const Vec3 stylus = tick.device.orientation * Vec3::UnitY();
    view.angle_deg = std::acos(std::clamp(stylus.dot(felt.normal), -1.0, 1.0)) * 180 / std::numbers::pi;
  }
  return view;
}

wire::F64x4 Reporter::quaternion(const Quat& q) const {
  if (config_.quaternionOrder == QuaternionOrder::wxyz) return {q.w(), q.x(), q.y(), q.z()};
  return {q.x(), q.y(), q.z(), q.w()};
}

void Reporter::update(const realtime::TickReport& tick, std::vector<Outgoing>& out) {
  buttons(tick, out);
  errors(tick, out);
  const bool over = touching_ && !tick.rendering.touching;
  if (tick.time < due_ && !over) return;
  due_ = std::max(due_ + period_, tick.time - period_ / 2);
  const View view = viewOf(tick);
  tracker(view, out);
  if (over) {
    contactEnd(view, out);
  } else {
    contact(view, out);
  }
  touching_ = view.touching;
  out.push_back({wire::IsTouching{flag(view.touching)}, false});
}

// What clamps the force is part of normal rendering; what takes it away is told, and its end too.
void Reporter::errors(const realtime::TickReport& tick, std::vector<Outgoing>& out) {
  const std::uint32_t tripped =
      (tick.guard.active | tick.guard.latched) & ~realtime::tripsOf(realtime::TripKind::clamp);
  if (tripped == tripped_) return;
  for (const realtime::TripInfo& trip : realtime::kTrips) {
    if ((tripped & ~tripped_ & realtime::bit(trip.trip)) != 0) {
      out.push_back({wire::ForceError{static_cast<std::int32_t>(trip.error)}, true});
    }
  }
  if (tripped == 0)
    out.push_back({wire::ForceError{static_cast<std::int32_t>(realtime::ForceError::ok)}, true});
  tripped_ = tripped;
}

wire::ButtonStates Reporter::buttonStates(std::uint32_t buttons) const {
  wire::ButtonStates states;
  for (int i = 0; i < buttonCount_; ++i) {
    states.states.values.push_back(static_cast<std::int32_t>(buttons >> i & 1U));
  }
  return states;
}

void Reporter::buttons(const realtime::TickReport& tick, std::vector<Outgoing>& out) {
  const std::uint32_t changed = tick.device.buttons ^ buttons_;
  for (std::int32_t i = 0; changed >> i != 0 && i < 32; ++i) {
    if ((changed >> i & 1U) != 0) {
      out.push_back({wire::ButtonChange{i, static_cast<std::int32_t>(tick.device.buttons >> i & 1U)}, true});
    }
  }
  buttons_ = tick.device.buttons;
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

void Reporter::tracker(const View& view, std::vector<Outgoing>& out) {
  const auto report = [&](std::int32_t sensor, const Vec3& position) {
    if (!moved(sensor, position, view.orientation)) return;
    out.push_back({wire::TrackerPosQuat{.sensor = sensor,
                                        .filler = sensor,
                                        .position = array(position),
                                        .orientation = quaternion(view.orientation)},
                   false});
    if (sensor != kSensorHip) return;
    // VRPN gives angular velocity as the rotation during an interval.
    constexpr double kInterval_s = 0.01;
    const double angle = view.angularVelocity.norm() * kInterval_s;
    const Quat turn =
        angle > 0 ? Quat(Eigen::AngleAxisd(angle, view.angularVelocity.normalized())) : Quat::Identity();
    out.push_back({wire::TrackerVelocity{.sensor = sensor,
                                         .filler = sensor,
                                         .velocity = array(view.velocity),
                                         .rotation = quaternion(turn),
                                         .interval = kInterval_s},
                   false});
  };
  report(kSensorProxy, view.proxy);
  report(kSensorHip, view.hip);
  if (view.touching) report(kSensorContact, view.scp);
}

void Reporter::contact(const View& view, std::vector<Outgoing>& out) {
  if ((view.force_N - force_N_).norm() > kForceStep_N) {
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
  if (!view.touching) return;
  if (view.scp != scp_) {
    scp_ = view.scp;
    out.push_back({wire::Scp{array(view.scp), quaternion(view.orientation)}, false});
  }
  if (view.angle_deg != angle_deg_ || !touching_) {
    angle_deg_ = view.angle_deg;
    out.push_back({wire::Angle{view.angle_deg, 1}, false});
  }
}

// The last words of a contact must arrive, or a client would believe in it for ever.
void Reporter::contactEnd(const View& view, std::vector<Outgoing>& out) {
  force_N_ = view.force_N;
  depth_ = 0;
  object_ = -1;
  angle_deg_ = 0;
  scp_ = Vec3::Constant(1e300);
  out.push_back({wire::Force{array(view.force_N)}, true});
  out.push_back({wire::Dop{0}, true});
  out.push_back({wire::TouchedObject{-1}, true});
  out.push_back({wire::Angle{0, 0}, true});
}

void Reporter::presentState(const realtime::TickReport& tick, std::vector<Outgoing>& out) const {
  Reporter fresh(config_, buttonCount_, config_.reportRate_Hz);
  fresh.touching_ = !tick.rendering.touching;  // so that either kind of contact state is said in full
  fresh.force_N_ = Vec3::Constant(1e300);
  fresh.depth_ = 1e300;
  fresh.object_ = -2;
  fresh.due_ = 0;
  out.push_back({buttonStates(tick.device.buttons), true});
  fresh.buttons_ = tick.device.buttons;
  fresh.update(tick, out);
  for (Outgoing& message : out) message.reliable = true;
}

}  // namespace hapticd::server
