// Everything a room asks of the world outside its process: time, threads, files, random numbers. Sockets have their own
// seam in net/. The script check_includes.sh fails where a room calls the system itself; docs/decisions/0007 says why
// this is one process-wide value and not a constructor's argument.
#pragma once

#include <cstdint>

#include "base/clock.h"
#include "base/files.h"
#include "base/thread.h"

namespace hapticd::base {

/// Random numbers for what needs no secrecy (identities, jitter).
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

/// The machine's world, or the one that a ScopedWorld put in its place. From any thread.
const World& world() noexcept;

/// Replaces the world while it lives. Make it before, and destroy it after, everything that uses the world; one at a time.
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
inline void sleepFor(Nanos duration) noexcept {
  world().clock.sleepUntil(now() + duration);
}

}  // namespace hapticd::base
