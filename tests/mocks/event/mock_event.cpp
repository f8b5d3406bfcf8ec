// Preloaded into a program: the file that HAPTICD_MOCK_EVENT names is then an input device whose kernel is
// the test in another process. Reads, writes and waiting go over one socket as they are; each ioctl is asked
// and answered on a second one.
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/input.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdlib>
#include <cstring>
#include <mutex>

#include "mocks/event/event_wire.h"

#define EXPORT extern "C" __attribute__((visibility("default")))

using namespace hapticd::mock;

namespace {

std::atomic<int> device{-1};
int questions = -1;
std::mutex& asking() {
  static auto* one = new std::mutex;
  return *one;
}

int join(const char* path, const char* ending, int type) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::size_t length = std::strlen(path);
  std::memcpy(address.sun_path, path, length);
  std::memcpy(address.sun_path + length, ending, std::strlen(ending));
  const int fd = socket(AF_UNIX, type | SOCK_CLOEXEC, 0);
  if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return fd;
  close(fd);
  errno = ENOENT;
  return -1;
}

int openDevice(const char* path) {
  questions = join(path, ".ioctl", SOCK_SEQPACKET);
  const int fd = join(path, "", SOCK_STREAM);
  if (fd < 0 || questions < 0) return -1;
  fcntl(fd, F_SETFL, O_NONBLOCK);
  device = fd;
  return fd;
}

bool isOurs(const char* path) {
  const char* ours = std::getenv("HAPTICD_MOCK_EVENT");
  return ours != nullptr && std::strcmp(ours, path) == 0;
}

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

EXPORT int open(const char* path, int flags, ...) {
  std::va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  if (isOurs(path)) return openDevice(path);
  static const auto real = next<int (*)(const char*, int, ...)>("open");
  return real(path, flags, mode);
}

EXPORT int ioctl(int fd, unsigned long request, ...) {
  std::va_list rest;
  va_start(rest, request);
  void* argument = va_arg(rest, void*);
  va_end(rest);
  if (fd < 0 || fd != device) {
    static const auto real = next<int (*)(int, unsigned long, ...)>("ioctl");
    return real(fd, request, argument);
  }
  const std::lock_guard lock(asking());
  IoctlMessage message;
  message.request = request;
  const bool byValue = request == EVIOCRMFF;
  const std::size_t size = byValue ? 0 : _IOC_SIZE(request);
  message.number = reinterpret_cast<long>(argument);
  if (size > sizeof message.data) return errno = EINVAL, -1;
  std::memcpy(message.data, argument, size);
  if (send(questions, &message, sizeof message, MSG_NOSIGNAL) < 0 ||
      recv(questions, &message, sizeof message, 0) != sizeof message) {
    return errno = ENODEV, -1;
  }
  std::memcpy(argument, message.data, size);
  errno = message.error;
  return message.error == 0 ? 0 : -1;
}

EXPORT ssize_t read(int fd, void* data, size_t size) {
  static const auto real = next<ssize_t (*)(int, void*, size_t)>("read");
  const ssize_t got = real(fd, data, size);
  if (fd < 0 || fd != device || got != 0) return got;
  errno = ENODEV;
  return -1;
}

EXPORT ssize_t write(int fd, const void* data, size_t size) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t)>("write");
  if (fd < 0 || fd != device) return real(fd, data, size);
  const ssize_t sent = send(fd, data, size, MSG_NOSIGNAL);
  if (sent < 0 && errno == EPIPE) errno = ENODEV;
  return sent;
}

EXPORT int close(int fd) {
  static const auto real = next<int (*)(int)>("close");
  int ours = fd;
  if (fd >= 0 && device.compare_exchange_strong(ours, -1)) real(questions);
  return real(fd);
}
