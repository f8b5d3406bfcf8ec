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
#include <string>
#include <system_error>

#include "base/world.h"

namespace hapticd::device::isolation {

namespace {

constexpr double kLargest = 1e6;

// A number of the other process, if a device can have it.
template <class T>
T within(const char* name, T value, T least, T most) {
  if (value >= least && value <= most) return value;
  throw std::runtime_error(std::string("the driver's process reports the impossible ") + name + ' ' +
                           std::to_string(value));
}

std::array<double, 3> numbers(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

Vec3 vector(const std::array<double, 3>& n) {
  return {n[0], n[1], n[2]};
}

}  // namespace

Posted Posted::of(const DeviceState& state) {
  Posted posted;
  posted.stateTime = state.time;
  posted.position_m = numbers(state.position_m);
  const Quat& q = state.orientation;
  posted.orientation_xyzw = {q.x(), q.y(), q.z(), q.w()};
  posted.velocity_m_per_s = numbers(state.velocity_m_per_s);
  posted.angularVelocity_rad_per_s = numbers(state.angularVelocity_rad_per_s);
  posted.buttons = state.buttons;
  posted.hold = state.hold;
  posted.motorTemperature = state.motorTemperature;
  posted.gripper_rad = state.gripper_rad.value_or(0);
  posted.hasGripper = state.gripper_rad ? 1 : 0;
  return posted;
}

DeviceState Posted::toState() const {
  DeviceState state;
  state.time = stateTime;
  state.position_m = vector(position_m);
  state.orientation =
      Quat(orientation_xyzw[3], orientation_xyzw[0], orientation_xyzw[1], orientation_xyzw[2]);
  state.velocity_m_per_s = vector(velocity_m_per_s);
  state.angularVelocity_rad_per_s = vector(angularVelocity_rad_per_s);
  state.buttons = buttons;
  state.hold = hold;
  state.motorTemperature = motorTemperature;
  if (hasGripper != 0) state.gripper_rad = gripper_rad;
  return state;
}

SharedProfile SharedProfile::of(const DeviceProfile& profile, const DeviceTraits& traits) {
  SharedProfile shared;
  profile.model.copy(shared.model.data(), shared.model.size() - 1);
  const Vec3& least = profile.workspace_m.min;
  const Vec3& most = profile.workspace_m.max;
  shared.workspace_m = {least.x(), least.y(), least.z(), most.x(), most.y(), most.z()};
  shared.peakForce_N = profile.peakForce_N;
  shared.continuousForce_N = profile.continuousForce_N;
  shared.nominalStiffness_N_per_m = profile.nominalStiffness_N_per_m;
  shared.ownDamping_Ns_per_m = profile.ownDamping_Ns_per_m;
  shared.transportDelay_s = profile.transportDelay_s;
  shared.buttons = profile.buttons;
  shared.switches = profile.switches;
  shared.inputDof = profile.inputDof;
  shared.outputDof = profile.outputDof;
  shared.hasGripper = profile.hasGripper ? 1 : 0;
  shared.startsArmed = profile.startsArmed ? 1 : 0;
  shared.calibratesInLoop = traits.calibratesInLoop ? 1 : 0;
  shared.needsRearm = traits.needsRearm ? 1 : 0;
  shared.forceLife = traits.forceLife;
  return shared;
}

DeviceProfile SharedProfile::toProfile() const {
  DeviceProfile profile;
  profile.model.assign(model.data(), strnlen(model.data(), model.size()));
  for (int i = 0; i < 3; ++i) {
    const auto at = static_cast<std::size_t>(i);
    profile.workspace_m.min[i] = within("workspace", workspace_m[at], -kLargest, kLargest);
    profile.workspace_m.max[i] =
        within("workspace", workspace_m[at + 3], profile.workspace_m.min[i], kLargest);
  }
  profile.peakForce_N = within("peak force", peakForce_N, 0.0, kLargest);
  profile.continuousForce_N = within("continuous force", continuousForce_N, 0.0, kLargest);
  profile.nominalStiffness_N_per_m = within("stiffness", nominalStiffness_N_per_m, 0.0, kLargest);
  profile.ownDamping_Ns_per_m = within("damping", ownDamping_Ns_per_m, 0.0, kLargest);
  profile.transportDelay_s = within("delay", transportDelay_s, 0.0, 1.0);
  profile.buttons = within("number of buttons", buttons, 0, 32);
  profile.switches = switches;
  profile.inputDof = within("number of inputs", inputDof, 0, 16);
  profile.outputDof = within("number of motors", outputDof, 0, 16);
  profile.hasGripper = hasGripper != 0;
  profile.startsArmed = startsArmed != 0;
  return profile;
}

DeviceTraits SharedProfile::toTraits() const {
  DeviceTraits traits;
  traits.selfPaced = true;
  traits.calibratesInLoop = calibratesInLoop != 0;
  traits.needsRearm = needsRearm != 0;
  traits.forceLife = within<Nanos>("life of a force", forceLife, 0, 1'000'000'000);
  return traits;
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
