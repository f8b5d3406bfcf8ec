#include "device/whole_server/event_kernel.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>

#include "mocks/event/event_wire.h"

namespace hapticd::whole_server {
namespace {

int listenOn(const std::string& path, int type) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) throw std::length_error(path);
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  const int fd = socket(AF_UNIX, type | SOCK_CLOEXEC, 0);
  if (bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 || listen(fd, 4) != 0) {
    throw std::runtime_error(path + ": " + std::strerror(errno));
  }
  return fd;
}

}  // namespace

EventKernel::EventKernel(const std::string& file, device::FakeJoystick& joystick)
    : joystick_(joystick),
      device_(joystick),
      fileListener_(listenOn(file, SOCK_STREAM)),
      ioctlListener_(listenOn(file + ".ioctl", SOCK_SEQPACKET)),
      stop_(eventfd(0, EFD_CLOEXEC)),
      thread_([this] { run(); }) {}

EventKernel::~EventKernel() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(stop_, &one, sizeof one);
  thread_.join();
  for (const int fd : {fileListener_, ioctlListener_, stop_, file_.load(), ioctls_}) {
    if (fd >= 0) close(fd);
  }
}

void EventKernel::run() {
  for (;;) {
    pollfd all[] = {{stop_, POLLIN, 0},
                    {ioctlListener_, POLLIN, 0},
                    {fileListener_, POLLIN, 0},
                    {ioctls_, POLLIN, 0},
                    {file_, POLLIN, 0}};
    if (poll(all, 5, -1) < 0) continue;
    if (all[0].revents != 0) return;
    if (all[1].revents != 0) {
      if (ioctls_ >= 0) close(ioctls_);
      ioctls_ = ::accept4(ioctlListener_, nullptr, nullptr, SOCK_CLOEXEC);
    }
    if (all[2].revents != 0) accept();
    if (all[3].revents != 0) answer();
    if (all[4].revents != 0) obey();
  }
}

void EventKernel::accept() {
  const std::lock_guard lock(mutex_);
  if (file_ >= 0) close(file_);
  file_ = ::accept4(fileListener_, nullptr, nullptr, SOCK_CLOEXEC);
  half_.clear();
  ++opened_;
}

void EventKernel::answer() {
  mock::IoctlMessage message;
  if (recv(ioctls_, &message, sizeof message, 0) != sizeof message) {
    close(ioctls_);
    ioctls_ = -1;
    return;
  }
  errno = 0;
  void* argument = message.request == EVIOCRMFF ? reinterpret_cast<void*>(message.number) : message.data;
  message.error = device_.control(message.request, argument) ? 0 : (errno != 0 ? errno : EIO);
  send(ioctls_, &message, sizeof message, MSG_NOSIGNAL);
}

void EventKernel::obey() {
  unsigned char bytes[16 * sizeof(input_event)];
  const long size = recv(file_, bytes, sizeof bytes, MSG_DONTWAIT);
  if (size < 0 && (errno == EAGAIN || errno == EINTR)) return;
  if (size <= 0) {
    forget();
    return;
  }
  half_.insert(half_.end(), bytes, bytes + size);
  for (; half_.size() >= sizeof(input_event);
       half_.erase(half_.begin(), half_.begin() + sizeof(input_event))) {
    device_.write(half_.data(), sizeof(input_event));
  }
}

void EventKernel::forget() {
  {
    const std::lock_guard lock(mutex_);
    if (file_ >= 0) close(file_);
    file_ = -1;
  }
  const std::lock_guard lock(joystick_.mutex);
  joystick_.effects.clear();
  joystick_.playing.clear();
}

void EventKernel::move(double x, double z) {
  const auto count = [&](double at) { return static_cast<int>(std::lround(at * joystick_.maximum)); };
  input_event events[2] = {};
  events[0].type = events[1].type = EV_ABS;
  events[0].code = ABS_X;
  events[0].value = count(x);
  events[1].code = ABS_Y;
  events[1].value = count(z);
  const std::lock_guard lock(mutex_);
  if (file_ >= 0) send(file_, events, sizeof events, MSG_NOSIGNAL);
}

void EventKernel::unplug() {
  {
    const std::lock_guard lock(joystick_.mutex);
    joystick_.error = ENODEV;
    joystick_.effects.clear();
    joystick_.playing.clear();
  }
  const std::lock_guard lock(mutex_);
  if (file_ >= 0) shutdown(file_, SHUT_RDWR);
}

void EventKernel::plugIn() {
  const std::lock_guard lock(joystick_.mutex);
  joystick_.error = 0;
}

}  // namespace hapticd::whole_server
