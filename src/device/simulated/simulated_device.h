// A device made of arithmetic: a point mass held by a spring-damper hand that follows an intended path.
//
// Contact pushes the mass back, so forces are closed-loop and an unstable wall shows. Time is what read() is
// told: the same calls give the same bytes, in real time or as fast as the machine can.
#pragma once

#include <memory>

#include "device/device.h"
#include "device/profiles.h"
#include "device/simulated/hand_path.h"
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
  /// How fast the intention moves when it changes its source, and always towards an external target.
  double reachSpeed_m_per_s = 0.5;
};

/// Without a path and a target the hand rests at the centre of the workspace.
class SimulatedDevice final : public Device {
 public:
  explicit SimulatedDevice(const SimulatedOptions& options = {});

  /// Back to the beginning: the next read() starts the path and puts the mass on it.
  void open() override;
  void close() noexcept override {}
  const DeviceProfile& profile() const noexcept override { return options_.profile; }

  bool read(Nanos now, DeviceState& state) noexcept override;
  bool write(const Vec3& force_N) noexcept override;

  /// The hand reaches for the start of the path at the next read() and then follows it. Null: it rests. One
  /// thread at a time, not the servo's; paths are freed there.
  void setPath(std::shared_ptr<const HandPath> path);
  /// The hand reaches for this pose until the next call; the path waits. One thread at a time, not the
  /// servo's; wait-free.
  void setTarget(const HandPose& pose) noexcept { target_.write({true, pose}); }
  /// The hand goes back to its path. Same thread as setTarget.
  void releaseTarget() noexcept { target_.write({}); }

 private:
  struct Target {
    bool active = false;
    HandPose pose;
  };
  // A fixed box around the path, so that "no path" can go through the slot, too.
  struct Script {
    std::shared_ptr<const HandPath> path;
  };

  void chooseSource() noexcept;
  HandPose wanted() const noexcept;
  void intend(Nanos step) noexcept;
  void reach(const HandPose& goal, double step_s) noexcept;
  void move(double step_s) noexcept;
  void fill(DeviceState& state, Nanos elapsed) noexcept;

  const SimulatedOptions options_;
  handoff::ExchangeSlot<Script> scripts_;
  handoff::LatestValue<Target> target_;

  // The servo's from here on.
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
