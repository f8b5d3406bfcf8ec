#include "device/simulated/simulated_device.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "base/time.h"

namespace hapticd::device {
namespace {

constexpr Nanos kSubStep = 50'000;
constexpr Nanos kLongestRead = 100'000'000;  // a pause longer than this did not happen to the hand
constexpr double kTurn_rad_per_s = 6;        // while reaching

bool isFinite(const HandPose& pose) noexcept {
  return pose.position_m.allFinite() && pose.velocity_m_per_s.allFinite() &&
         pose.orientation.coeffs().allFinite();
}

}  // namespace

SimulatedDevice::SimulatedDevice(const SimulatedOptions& options) : options_(options) {
  intended_.position_m = options_.profile.workspace_m.centre();
}

void SimulatedDevice::open() {
  if (!options_.remark.empty()) std::fprintf(stderr, "%s\n", options_.remark.c_str());
  started_ = false;
  force_N_.setZero();
}

void SimulatedDevice::setPath(std::shared_ptr<const HandPath> path) {
  scripts_.publish(std::make_shared<const Script>(Script{std::move(path)}));
}

bool SimulatedDevice::write(const Vec3& force_N) noexcept {
  if (!force_N.allFinite()) return false;
  force_N_ = force_N;
  forceEnded_.store(false, std::memory_order_release);
  return true;
}

bool SimulatedDevice::read(Nanos now, DeviceState& state) noexcept {
  if (forceEnded_.load(std::memory_order_acquire)) force_N_.setZero();
  chooseSource();
  const Nanos elapsed = started_ ? std::clamp<Nanos>(now - time_, 0, kLongestRead) : 0;
  if (!started_) {
    started_ = true;
    reaching_ = false;
    onPath_ = 0;
    intended_ = wanted();
    position_m_ = intended_.position_m;
    velocity_m_per_s_ = intended_.velocity_m_per_s;
    orientation_ = intended_.orientation;
  }
  for (Nanos done = 0; done < elapsed;) {
    const Nanos step = std::min(kSubStep, elapsed - done);
    move(base::toSeconds(step));
    intend(step);
    done += step;
  }
  if (options_.openLoop || !position_m_.allFinite() || !velocity_m_per_s_.allFinite()) {
    position_m_ = intended_.position_m;
    velocity_m_per_s_ = intended_.velocity_m_per_s;
  }
  time_ = now;
  fill(state, elapsed);
  return true;
}

void SimulatedDevice::chooseSource() noexcept {
  const Script* newest = scripts_.take();
  if (newest != script_) {
    script_ = newest;
    onPath_ = 0;
    reaching_ = true;
  }
  const Target& target = target_.read();
  if (target.active && !isFinite(target.pose)) return;  // keeps the previous one
  if (target.active != external_.active) reaching_ = true;
  external_ = target;
}

HandPose SimulatedDevice::wanted() const noexcept {
  if (external_.active) return external_.pose;
  if (script_ != nullptr && script_->path) {
    const HandPose onPath = script_->path->at(onPath_);
    if (isFinite(onPath)) return onPath;
  }
  HandPose rest;
  rest.position_m = options_.profile.workspace_m.centre();
  return rest;
}

void SimulatedDevice::intend(Nanos step) noexcept {
  if (external_.active || (reaching_ && !options_.openLoop)) {
    reach(wanted(), base::toSeconds(step));
  } else {
    onPath_ += step;
    intended_ = wanted();
  }
}

// Towards the goal at no more than a hand's speed. The path stands still meanwhile, so that it is met at rest
// where it was left.
void SimulatedDevice::reach(const HandPose& goal, double step_s) noexcept {
  const Vec3 way = goal.position_m - intended_.position_m;
  const double distance = way.norm();
  const double reachable = options_.reachSpeed_m_per_s * step_s;
  const double angle = intended_.orientation.angularDistance(goal.orientation);
  const double turnable = kTurn_rad_per_s * step_s;
  if (distance <= reachable && angle <= turnable) reaching_ = false;

  intended_.position_m =
      distance <= reachable ? goal.position_m : intended_.position_m + reachable / distance * way;
  intended_.orientation =
      angle <= turnable ? goal.orientation : intended_.orientation.slerp(turnable / angle, goal.orientation);
  intended_.velocity_m_per_s.setZero();
  intended_.buttons = goal.buttons;
}

double SimulatedDevice::strength_N() const noexcept {
  const bool follows = !external_.active && script_ != nullptr && script_->path;
  return follows ? script_->path->strength_N() : std::numeric_limits<double>::infinity();
}

// Implicit in the damper, so that no step is too long for it; symplectic in the spring.
void SimulatedDevice::move(double step_s) noexcept {
  const double b = options_.handDamping_Ns_per_m;
  Vec3 hand_N =
      options_.handStiffness_N_per_m * (intended_.position_m - position_m_) + b * intended_.velocity_m_per_s;
  const double strength = strength_N();
  if (hand_N.squaredNorm() > strength * strength) hand_N *= strength / hand_N.norm();
  velocity_m_per_s_ =
      (options_.mass_kg * velocity_m_per_s_ + step_s * (hand_N + force_N_)) / (options_.mass_kg + step_s * b);
  position_m_ += step_s * velocity_m_per_s_;
}

void SimulatedDevice::fill(DeviceState& state, Nanos elapsed) noexcept {
  state.time = time_;
  state.position_m = position_m_;
  state.velocity_m_per_s = velocity_m_per_s_;
  state.orientation = intended_.orientation;
  state.buttons = intended_.buttons;
  state.hold = kHoldNone;
  state.motorTemperature = 0;
  state.angularVelocity_rad_per_s.setZero();
  if (elapsed > 0) {
    const Eigen::AngleAxisd turn(intended_.orientation * orientation_.conjugate());
    state.angularVelocity_rad_per_s = turn.angle() / base::toSeconds(elapsed) * turn.axis();
  }
  orientation_ = intended_.orientation;
}

}  // namespace hapticd::device
