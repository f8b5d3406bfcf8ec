#include "realtime/servo/wake.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <system_error>

namespace hapticd::realtime {

Wake::Wake() : descriptor_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (descriptor_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
}

Wake::~Wake() {
  close(descriptor_);
}

void Wake::notify() noexcept {
  const std::uint64_t one = 1;
  // A counter at its limit refuses the write but stays readable.
  [[maybe_unused]] const auto written = write(descriptor_, &one, sizeof one);
}

bool Wake::drain() noexcept {
  std::uint64_t count = 0;
  return read(descriptor_, &count, sizeof count) == sizeof count && count > 0;
}

}  // namespace hapticd::realtime
