// Memory shared by a driver's process and the server: the newest state one way, the newest force the other.
//
// Both directions are LatestValue, which needs no lock and survives the death of either side in the middle of
// a write. Each post of a state counts up a futex word that the server's loop sleeps on.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>

#include "base/world.h"
#include "device/device.h"
#include "handoff/latest_value.h"

namespace hapticd::device::isolation {

inline constexpr int kMemoryDescriptor = 3;  // in the driver's process
inline constexpr int kSocketDescriptor = 4;

/// The driver's process zeroes a force that is older than this, in ticks of this period.
constexpr Nanos commandLife(Nanos period) {
  return std::max<Nanos>(3'000'000, period + period / 2);
}

/// A state without types that some bytes are no value of: the driver's process may leave anything here.
struct Posted {
  Nanos stateTime = 0;
  std::array<double, 3> position_m{};
  std::array<double, 4> orientation_xyzw{0, 0, 0, 1};
  std::array<double, 3> velocity_m_per_s{};
  std::array<double, 3> angularVelocity_rad_per_s{};
  std::uint32_t buttons = 0;
  std::uint32_t hold = 0;
  double motorTemperature = 0;
  double gripper_rad = 0;
  std::uint32_t hasGripper = 0;
  std::uint32_t valid = 0;
  std::uint32_t lost = 0;
  Nanos time = 0;  ///< of the post, CLOCK_MONOTONIC

  static Posted of(const DeviceState& state);
  /// Numbers as they were posted, also those that are not finite.
  DeviceState toState() const;
};

struct Command {
  Vec3 force_N = Vec3::Zero();
  std::uint64_t number = 0;
};

/// A profile without pointers, and what of the traits the server needs.
struct SharedProfile {
  std::array<char, 128> model{};
  std::array<double, 6> workspace_m{};  ///< min xyz, max xyz
  double peakForce_N = 0;
  double continuousForce_N = 0;
  double nominalStiffness_N_per_m = 0;
  double ownDamping_Ns_per_m = 0;
  double transportDelay_s = 0;
  int buttons = 0;
  std::uint32_t switches = 0;
  int inputDof = 0;
  int outputDof = 0;
  std::uint32_t hasGripper = 0;
  std::uint32_t startsArmed = 0;
  std::uint32_t calibratesInLoop = 0;
  std::uint32_t needsRearm = 1;
  Nanos forceLife = 0;

  static SharedProfile of(const DeviceProfile& profile, const DeviceTraits& traits);
  /// Throws std::runtime_error, naming the value, when no device has such a profile.
  DeviceProfile toProfile() const;
  /// Those of an isolated device: self-paced in a thread of ours. Throws as toProfile().
  DeviceTraits toTraits() const;
};

/// Made by the server; both processes are the same build.
struct SharedBlock {
  std::uint64_t size = sizeof(SharedBlock);
  SharedProfile profile;  ///< set before the first answer on the socket
  std::atomic<std::uint32_t> posts{0};
  handoff::LatestValue<Posted> state;
  handoff::LatestValue<Command> command;
  std::atomic<std::uint32_t> stopsCalibration{0};  ///< 1: one that runs ends
  std::atomic<std::uint64_t> sentUpTo{0};          ///< the driver has sent its command, or a zero after it
  std::atomic<std::uint64_t> endedUpTo{0};         ///< commands up to this number exert no force any more
};
static_assert(std::atomic<std::uint32_t>::is_always_lock_free &&
              std::atomic<std::uint8_t>::is_always_lock_free);

/// The block in a file of memory, mapped as long as this lives.
class SharedMemory {
 public:
  /// A new block. Throws std::system_error.
  SharedMemory();
  /// The block that the other process made; takes the descriptor. Throws std::runtime_error when it is
  /// another build's.
  explicit SharedMemory(int descriptor);
  ~SharedMemory();
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;

  int descriptor() const noexcept { return descriptor_; }
  SharedBlock& operator*() const noexcept { return *block_; }
  SharedBlock* operator->() const noexcept { return block_; }

 private:
  void map();

  int descriptor_;
  SharedBlock* block_ = nullptr;
};

/// Sleeps until `word` is no longer `seen`, for at most this time. Between processes; noexcept, no
/// allocation.
void waitForChange(const std::atomic<std::uint32_t>& word, std::uint32_t seen, Nanos most) noexcept;
/// Counts up and wakes whoever waits: one call into the system that does not block.
void countUp(std::atomic<std::uint32_t>& word) noexcept;

}  // namespace hapticd::device::isolation
