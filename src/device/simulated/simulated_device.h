// A simulated device: a point mass held by a spring-damper hand that follows an intended path.
//
// Contact pushes the mass back, so forces are closed-loop and an unstable wall shows. Time is the argument of
// read(): the same calls give the same bytes, in real time or as fast as the machine can.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "device/device.h"
#include "device/profiles.h"
#include "device/simulated/steered_hand.h"
#include "handoff/exchange_slot.h"
#include "handoff/latest_value.h"

namespace hapticd::device {

struct SimulatedOptions {
  DeviceProfile profile = profiles().front();
  double mass_kg = 0.1;
  double handStiffness_N_per_m = 300;
  double handDamping_Ns_per_m = 5;
  /// The device is where the path is, whatever the force: for offline rendering.
  bool openLoop = false;
  /// Speed of the intended position after a change of its source, and always towards a target.
  double reachSpeed_m_per_s = 0.5;
  /// On the file of the path; open() prints it.
  std::string remark = {};
};

/// Without a path and a target the hand rests at the centre of the workspace.
class SimulatedDevice final : public Device, public SteeredHand {
 public:
  explicit SimulatedDevice(const SimulatedOptions& options = {});

  /// Rewinds: the next read() starts the path and puts the mass on it.
  void open() override;
  void close() noexcept override {}
  const DeviceProfile& profile() const noexcept override { return options_.profile; }
  DeviceTraits traits() const noexcept override { return {.needsRearm = false}; }
  SteeredHand* steered() noexcept override { return this; }

  bool read(Nanos now, DeviceState& state) noexcept override;
  bool write(const Vec3& force_N) noexcept override;
  bool zeroFromOtherThread() noexcept override {
    forceEnded_.store(true, std::memory_order_release);
    return true;
  }

  void setPath(std::shared_ptr<const HandPath> path) override;
  void setTarget(const HandPose& pose) noexcept override { target_.write({true, pose}); }
  void releaseTarget() noexcept override { target_.write({}); }

 private:
  struct Target {
    bool active = false;
    HandPose pose;
  };
  // Wraps the path so that the slot can also carry "no path".
  struct Script {
    std::shared_ptr<const HandPath> path;
  };

  void chooseSource() noexcept;
  HandPose wanted() const noexcept;
  double strength_N() const noexcept;
  void intend(Nanos step) noexcept;
  void reach(const HandPose& goal, double step_s) noexcept;
  void move(double step_s) noexcept;
  void fill(DeviceState& state, Nanos elapsed) noexcept;

  const SimulatedOptions options_;
  handoff::ExchangeSlot<Script> scripts_;
  handoff::LatestValue<Target> target_;

  std::atomic<bool> forceEnded_{false};  // since the last write

  // Servo thread only, from here on.
  bool started_ = false;
  Nanos time_ = 0;
  const Script* script_ = nullptr;
  Nanos onPath_ = 0;  // time spent on the path
  Target external_;
  bool reaching_ = false;
  HandPose intended_;
  Vec3 position_m_ = Vec3::Zero();
  Vec3 velocity_m_per_s_ = Vec3::Zero();
  Vec3 force_N_ = Vec3::Zero();
  Quat orientation_ = Quat::Identity();
};

}  // namespace hapticd::device
