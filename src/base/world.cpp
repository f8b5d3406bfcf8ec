#include "base/world.h"

#include <sys/random.h>

#include <atomic>

namespace hapticd::base {
namespace {

const World& machineWorld() noexcept {
  // Never destroyed: threads may still read the time during static destruction.
  static auto& clock = *new MonotonicClock;
  static auto& threads = *new SystemThreads;
  static auto& files = *new SystemFiles;
  static auto& random = *new SystemRandom;
  static const World world{clock, threads, files, random};
  return world;
}

std::atomic<const World*> replacement{nullptr};

}  // namespace

std::uint64_t SystemRandom::next() {
  std::uint64_t value = 0;
  while (getrandom(&value, sizeof value, 0) != sizeof value) {
  }
  return value;
}

const World& world() noexcept {
  const World* const other = replacement.load(std::memory_order_acquire);
  return other != nullptr ? *other : machineWorld();
}

ScopedWorld::ScopedWorld(const World& world) noexcept : world_(world) {
  replacement.store(&world_, std::memory_order_release);
}

ScopedWorld::~ScopedWorld() {
  replacement.store(nullptr, std::memory_order_release);
}

}  // namespace hapticd::base
