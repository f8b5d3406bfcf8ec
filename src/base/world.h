// The seam between the rooms and the system: time, threads, files, random numbers. net/ has the seam for
// sockets. scripts/check_includes.sh fails where a room calls the system itself; docs/decisions/0007 gives
// the reason for one process-wide value instead of a constructor argument.
#pragma once

#include <cstdint>

#include "base/clock.h"
#include "base/files.h"
#include "base/thread.h"

namespace hapticd::base {

/// Random numbers that need not be secret (ids, jitter).
class Random {
 public:
  virtual ~Random() = default;
  /// Uniform over all values. From any thread.
  virtual std::uint64_t next() = 0;
};

/// The kernel's random numbers.
class SystemRandom final : public Random {
 public:
  std::uint64_t next() override;
};

struct World {
  Clock& clock;
  Threads& threads;
  Files& files;
  Random& random;
};

/// The world of the machine, or of the ScopedWorld that replaces it. From any thread.
const World& world() noexcept;

/// Replaces the world while it lives. Construct it before, and destroy it after, everything that uses the
/// world; only one at a time.
class ScopedWorld {
 public:
  explicit ScopedWorld(const World& world) noexcept;
  ~ScopedWorld();
  ScopedWorld(const ScopedWorld&) = delete;
  ScopedWorld& operator=(const ScopedWorld&) = delete;

 private:
  World world_;
};

/// Time on the servo clock.
inline Nanos now() noexcept {
  return world().clock.now();
}
/// Time since 1970, UTC.
inline Nanos wallNow() noexcept {
  return world().clock.wallNow();
}
/// Total time of suspension of the machine. Realtime: one thread may call it in every step.
inline Nanos suspendedTime() noexcept {
  return world().clock.suspendedTime();
}
inline void sleepFor(Nanos duration) noexcept {
  world().clock.sleepUntil(now() + duration);
}

}  // namespace hapticd::base
