// A Linux input device as a file: all calls of the driver into the kernel.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::device {

using base::Nanos;

/// For the thread that exchanges with the device; none of the calls throws.
class EventDevice {
 public:
  EventDevice() = default;
  virtual ~EventDevice() = default;
  EventDevice(const EventDevice&) = delete;
  EventDevice& operator=(const EventDevice&) = delete;

  /// ioctl; false with errno set when it fails.
  virtual bool control(unsigned long request, void* argument) noexcept = 0;
  /// Bytes read without waiting, 0 when there are none, -1 with errno set when it fails.
  virtual long read(void* data, std::size_t size) noexcept = 0;
  /// False with errno set when it fails.
  virtual bool write(const void* data, std::size_t size) noexcept = 0;
  /// Returns when there is something to read, or after this time.
  virtual void wait(Nanos most) noexcept = 0;
};

/// Opens /dev/input/event*. Throws std::system_error with the remedy where permission is missing.
std::unique_ptr<EventDevice> openEventDevice(const std::string& path);

/// All event* files in a folder, by number.
std::vector<std::string> eventDevicePaths(const std::filesystem::path& folder = "/dev/input");

}  // namespace hapticd::device
