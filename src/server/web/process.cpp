#include "server/web/process.h"

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>

namespace hapticd::server {

ProcessUsage processUsage() {
  ProcessUsage usage;
  std::uint64_t all = 0;
  std::uint64_t resident = 0;
  if (std::ifstream("/proc/self/statm") >> all >> resident) {
    const auto page = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
    usage.virtualBytes = all * page;
    usage.residentBytes = resident * page;
  }
  std::error_code error;
  const std::filesystem::directory_iterator files("/proc/self/fd", error);
  if (!error) {
    const auto count = std::distance(begin(files), end(files));
    usage.openFiles = static_cast<std::uint64_t>(count > 0 ? count - 1 : 0);  // without the one that reads
  }
  rusage times{};
  if (::getrusage(RUSAGE_SELF, &times) == 0) {
    const auto seconds = [](const timeval& t) {
      return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
    };
    usage.cpu_s = seconds(times.ru_utime) + seconds(times.ru_stime);
  }
  return usage;
}

}  // namespace hapticd::server
