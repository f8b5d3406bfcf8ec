// Memory that runs out: in hapticd-sim, operator new and anonymous mappings fail on request.
#pragma once

#include <cstddef>

namespace hapticd::sim {

/// While it lives, allocations of this size and more fail; with 0, none. The innermost one holds.
class LimitedMemory {
 public:
  explicit LimitedMemory(std::size_t fromBytes) noexcept;
  ~LimitedMemory();
  LimitedMemory(const LimitedMemory&) = delete;
  LimitedMemory& operator=(const LimitedMemory&) = delete;

  /// Allocations that failed since the program began.
  static std::size_t failures() noexcept;

 private:
  const std::size_t before_;
};

}  // namespace hapticd::sim
