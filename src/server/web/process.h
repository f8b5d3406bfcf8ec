// Resource usage of this process, for /metrics.
#pragma once

#include <cstdint>

namespace hapticd::server {

struct ProcessUsage {
  std::uint64_t residentBytes = 0;
  std::uint64_t virtualBytes = 0;
  std::uint64_t openFiles = 0;
  double cpu_s = 0;  ///< user and system time of all threads
};

/// Reads /proc/self and getrusage(2). A value that is not available is 0. Any thread.
ProcessUsage processUsage();

}  // namespace hapticd::server
