// Memory shared by a driver's process and the server: the newest state one way, the newest force the other.
//
// Both directions are LatestValue, which needs no lock and survives the death of either side in the middle of
// a write. Each post of a state counts up a futex word that the server's loop sleeps on.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "base/world.h"
#include "device/device.h"
#include "handoff/latest_value.h"

namespace hapticd::device::isolation {

inline constexpr int kMemoryDescriptor = 3;  // in the driver's process
inline constexpr int kSocketDescriptor = 4;

/// The driver's process zeroes a force that is older than this.
inline constexpr Nanos kCommandLife = 3'000'000;

struct Posted {
  DeviceState state;
  bool valid = false;
  bool lost = false;
  Nanos time = 0;  ///< of the post, CLOCK_MONOTONIC
};

struct Command {
  Vec3 force_N = Vec3::Zero();
  std::uint64_t number = 0;
};

/// A profile without pointers.
struct SharedProfile {
  std::array<char, 128> model{};
  geometry::Box workspace_m;
  double peakForce_N = 0;
  double continuousForce_N = 0;
  double nominalStiffness_N_per_m = 0;
  double ownDamping_Ns_per_m = 0;
  double transportDelay_s = 0;
  int buttons = 0;
  std::uint32_t switches = 0;
  int inputDof = 0;
  int outputDof = 0;
  bool hasGripper = false;
  bool startsArmed = false;

  static SharedProfile of(const DeviceProfile& profile);
  DeviceProfile toProfile() const;
};

/// Made by the server; both processes are the same build.
struct SharedBlock {
  std::uint64_t size = sizeof(SharedBlock);
  SharedProfile profile;  ///< set before the first answer on the socket
  DeviceTraits traits;    ///< likewise
  std::atomic<std::uint32_t> posts{0};
  handoff::LatestValue<Posted> state;
  handoff::LatestValue<Command> command;
  std::atomic<std::uint64_t> endedUpTo{0};  ///< commands up to this number exert no force any more
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
