#include "device/evdev/event_device.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

namespace hapticd::device {
namespace {

class EventFile final : public EventDevice {
 public:
  explicit EventFile(int descriptor) noexcept : descriptor_(descriptor) {}
  ~EventFile() override { ::close(descriptor_); }

  bool control(unsigned long request, void* argument) noexcept override {
    return ioctl(descriptor_, request, argument) >= 0;
  }
  long read(void* data, std::size_t size) noexcept override {
    const long count = ::read(descriptor_, data, size);
    return count < 0 && (errno == EAGAIN || errno == EINTR) ? 0 : count;
  }
  bool write(const void* data, std::size_t size) noexcept override {
    return ::write(descriptor_, data, size) == static_cast<ssize_t>(size);
  }
  void wait(Nanos most) noexcept override {
    pollfd wanted{descriptor_, POLLIN, 0};
    const timespec time{most / 1'000'000'000, most % 1'000'000'000};
    ppoll(&wanted, 1, &time, nullptr);
  }

 private:
  const int descriptor_;
};

}  // namespace

std::unique_ptr<EventDevice> openEventDevice(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) {
    const int error = errno;
    const std::string remedy =
        error == EACCES ? " (install packaging/udev/70-hapticd.rules, or add yourself to the group 'input')"
                        : "";
    throw std::system_error(error, std::generic_category(), path + remedy);
  }
  return std::make_unique<EventFile>(descriptor);
}

std::vector<std::string> eventDevicePaths(const std::filesystem::path& folder) {
  std::vector<std::string> paths;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    if (entry.path().filename().string().rfind("event", 0) == 0) paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end(), [](const std::string& a, const std::string& b) {
    return a.size() != b.size() ? a.size() < b.size() : a < b;
  });
  return paths;
}

}  // namespace hapticd::device
