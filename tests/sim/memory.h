// Memory that runs out. Programs that link memory.cpp, such as hapticd-sim, have an operator new and
// anonymous mappings that fail on request; elsewhere the limit has no effect.
#pragma once

#include <cstddef>

namespace hapticd::sim {

/// While it lives, allocations of this size and more fail; with 0, none. The innermost one holds. Everything
/// runs in one thread.
class LimitedMemory {
 public:
  explicit LimitedMemory(std::size_t fromBytes) noexcept : before_(limit) { limit = fromBytes; }
  ~LimitedMemory() { limit = before_; }
  LimitedMemory(const LimitedMemory&) = delete;
  LimitedMemory& operator=(const LimitedMemory&) = delete;

  static bool refuses(std::size_t bytes) noexcept { return limit != 0 && bytes >= limit; }

 private:
  // Before main(), too.
  static inline constinit std::size_t limit = 0;
  const std::size_t before_;
};

}  // namespace hapticd::sim
