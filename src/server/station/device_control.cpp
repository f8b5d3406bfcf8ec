#include "server/station/device_control.h"

#include <algorithm>
#include <cmath>

#include "scene/workspace.h"
#include "server/reports/client_tick.h"

namespace hapticd::server {
namespace {

using geometry::Quat;
using geometry::Vec3;

bool finite(const wire::HoldHand& m) {
  const auto ok = [](double x) { return std::isfinite(x); };
  return std::all_of(m.position.begin(), m.position.end(), ok) &&
         std::all_of(m.orientation.begin(), m.orientation.end(), ok);
}

}  // namespace

void DeviceControl::stopForces(const Order& order) {
  stop_ = order;
  guard_.stop();
}

bool DeviceControl::rearmForces(const Order& order) {
  const bool sentEarlier = order.address == stop_.address && order.sent < stop_.sent;
  if (order.received <= stop_.received || sentEarlier) return false;
  guard_.rearm();
  return true;
}

bool DeviceControl::hold(scene::ClientId client, const wire::HoldHand& wanted,
                         const realtime::TickReport& last, Refusal& refusal) {
  if (hand_ == nullptr) {
    refusal = {RefusalCode::handNotSimulated,
               "Hold_Hand refused: the device is real; only a simulated hand can be held"};
    return false;
  }
  if (holder_ && *holder_ != client) {
    // Releasing a hand that another client holds is not an error.
    if (wanted.hold == 0) return true;
    refusal = {RefusalCode::handHeldByOther,
               "Hold_Hand refused: client " + std::to_string(*holder_) + " holds the hand"};
    return false;
  }
  if (wanted.hold == 0) {
    releaseHand();
    return true;
  }
  if (!finite(wanted)) {
    refusal = {RefusalCode::handPoseInvalid, "Hold_Hand refused: position or orientation is not finite"};
    return false;
  }
  const Quat orientation(wanted.orientation[3], wanted.orientation[0], wanted.orientation[1],
                         wanted.orientation[2]);
  if (orientation.norm() < 1e-6) {
    refusal = {RefusalCode::handPoseInvalid,
               "Hold_Hand refused: the orientation is a zero quaternion; 0 0 0 1 is no rotation"};
    return false;
  }
  device::HandPose pose;
  const Vec3 world(wanted.position[0], wanted.position[1], wanted.position[2]);
  // Before the first tick report, use the initial workspace of a scene.
  const geometry::Affine T_world_device =
      last.tick == 0 ? scene::Workspace{}.T_world_device : last.T_world_device;
  pose.position_m = (T_world_device.inverse() * world).cwiseMax(workspace_m_.min).cwiseMin(workspace_m_.max);
  pose.orientation = (Quat(rotationOf(last)).conjugate() * orientation).normalized();
  pose.buttons = wanted.buttons;
  // The map to the device multiplies: finite numbers may leave it infinite or undefined.
  if (!pose.position_m.allFinite() || !pose.orientation.coeffs().allFinite()) {
    refusal = {RefusalCode::handPoseInvalid,
               "Hold_Hand refused: position or orientation is too large for the workspace"};
    return false;
  }
  holder_ = client;
  hand_->setTarget(pose);
  return true;
}

void DeviceControl::clientGone(scene::ClientId client) {
  if (holder_ == client) releaseHand();
}

void DeviceControl::releaseHand() {
  if (!std::exchange(holder_, std::nullopt)) return;
  hand_->releaseTarget();
}

}  // namespace hapticd::server
