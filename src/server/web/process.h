// What the system says of this process.
#pragma once

#include <cstdint>

namespace hapticd::server {

struct ProcessUsage {
  std::uint64_t residentBytes = 0;
  std::uint64_t virtualBytes = 0;
  std::uint64_t openFiles = 0;
  double cpu_s = 0;  ///< of all threads, in user and system
};

/// Reads /proc and asks the system; what cannot be had is 0.
ProcessUsage processUsage();

}  // namespace hapticd::server
