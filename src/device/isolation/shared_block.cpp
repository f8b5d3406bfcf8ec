#include "device/isolation/shared_block.h"

#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <climits>
#include <cstring>
#include <new>
#include <stdexcept>
#include <system_error>

#include "base/world.h"

namespace hapticd::device::isolation {

SharedProfile SharedProfile::of(const DeviceProfile& profile) {
  SharedProfile shared;
  profile.model.copy(shared.model.data(), shared.model.size() - 1);
  shared.workspace_m = profile.workspace_m;
  shared.peakForce_N = profile.peakForce_N;
  shared.continuousForce_N = profile.continuousForce_N;
  shared.nominalStiffness_N_per_m = profile.nominalStiffness_N_per_m;
  shared.ownDamping_Ns_per_m = profile.ownDamping_Ns_per_m;
  shared.transportDelay_s = profile.transportDelay_s;
  shared.buttons = profile.buttons;
  shared.switches = profile.switches;
  shared.inputDof = profile.inputDof;
  shared.outputDof = profile.outputDof;
  shared.hasGripper = profile.hasGripper;
  shared.startsArmed = profile.startsArmed;
  return shared;
}

DeviceProfile SharedProfile::toProfile() const {
  DeviceProfile profile;
  profile.model = model.data();
  profile.workspace_m = workspace_m;
  profile.peakForce_N = peakForce_N;
  profile.continuousForce_N = continuousForce_N;
  profile.nominalStiffness_N_per_m = nominalStiffness_N_per_m;
  profile.ownDamping_Ns_per_m = ownDamping_Ns_per_m;
  profile.transportDelay_s = transportDelay_s;
  profile.buttons = buttons;
  profile.switches = switches;
  profile.inputDof = inputDof;
  profile.outputDof = outputDof;
  profile.hasGripper = hasGripper;
  profile.startsArmed = startsArmed;
  return profile;
}

SharedMemory::SharedMemory() : descriptor_(memfd_create("hapticd-device", MFD_CLOEXEC)) {
  if (descriptor_ < 0 || ftruncate(descriptor_, sizeof(SharedBlock)) != 0) {
    throw std::system_error(errno, std::generic_category(), "shared memory for a driver");
  }
  map();
  new (block_) SharedBlock;
}

SharedMemory::SharedMemory(int descriptor) : descriptor_(descriptor) {
  if (lseek(descriptor_, 0, SEEK_END) != static_cast<off_t>(sizeof(SharedBlock))) {
    throw std::runtime_error("the shared memory is another build's, or this was not started by hapticd");
  }
  map();
}

void SharedMemory::map() {
  void* memory = mmap(nullptr, sizeof(SharedBlock), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, 0);
  if (memory == MAP_FAILED) throw std::system_error(errno, std::generic_category(), "mapping shared memory");
  block_ = static_cast<SharedBlock*>(memory);
}

SharedMemory::~SharedMemory() {
  munmap(block_, sizeof(SharedBlock));
  close(descriptor_);
}

void waitForChange(const std::atomic<std::uint32_t>& word, std::uint32_t seen, Nanos most) noexcept {
  const timespec time{most / 1'000'000'000, most % 1'000'000'000};
  syscall(SYS_futex, &word, FUTEX_WAIT, seen, &time, nullptr, 0);
}

void countUp(std::atomic<std::uint32_t>& word) noexcept {
  word.fetch_add(1, std::memory_order_release);
  syscall(SYS_futex, &word, FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
}

}  // namespace hapticd::device::isolation
