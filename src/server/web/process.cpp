#include "server/web/process.h"

#include <sys/resource.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <iterator>
#include <string>
#include <system_error>

#include "base/world.h"

namespace hapticd::server {
namespace {

// /proc/self/statm: total and resident size in pages, then numbers that are not needed.
void readMemory(ProcessUsage& usage) {
  std::string text;
  try {
    for (const std::byte b : base::world().files.read("/proc/self/statm")) text += static_cast<char>(b);
  } catch (const std::system_error&) {
    return;  // the values stay 0
  }
  unsigned long long all = 0;
  unsigned long long resident = 0;
  if (std::sscanf(text.c_str(), "%llu %llu", &all, &resident) != 2) return;
  const auto page = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  usage.virtualBytes = all * page;
  usage.residentBytes = resident * page;
}

}  // namespace

ProcessUsage processUsage() {
  ProcessUsage usage;
  if (base::world().threads.simulated()) return usage;  // the same in every run
  readMemory(usage);
  std::error_code error;
  const std::filesystem::directory_iterator files("/proc/self/fd", error);
  if (!error) {
    const auto count = std::distance(begin(files), end(files));
    usage.openFiles = static_cast<std::uint64_t>(count > 0 ? count - 1 : 0);  // not the directory itself
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
