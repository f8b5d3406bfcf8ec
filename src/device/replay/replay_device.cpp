#include "device/replay/replay_device.h"

#include <cstdio>

#include "base/time.h"

namespace hapticd::device {

void ReplayDevice::open() {
  hand_ = HandFile::load(options_.file);
  if (!hand_->remark().empty())
    std::fprintf(stderr, "%s: %s\n", options_.file.c_str(), hand_->remark().c_str());
  started_ = false;
}

bool ReplayDevice::write(const Vec3& force_N) noexcept {
  return force_N.allFinite();
}

bool ReplayDevice::read(Nanos now, DeviceState& state) noexcept {
  if (!hand_) return false;
  if (!started_) start_ = last_ = now;
  Nanos at = now - start_;
  if (options_.repeat && hand_->duration() > 0) at %= hand_->duration() + 1;
  const HandPose pose = hand_->at(at);

  state = DeviceState();
  state.time = now;
  state.position_m = pose.position_m;
  state.velocity_m_per_s = pose.velocity_m_per_s;
  state.orientation = pose.orientation;
  state.buttons = pose.buttons;
  if (started_ && now > last_) {
    const Eigen::AngleAxisd turn(pose.orientation * orientation_.conjugate());
    state.angularVelocity_rad_per_s = turn.angle() / base::toSeconds(now - last_) * turn.axis();
  }
  started_ = true;
  last_ = now;
  orientation_ = pose.orientation;
  return true;
}

}  // namespace hapticd::device
