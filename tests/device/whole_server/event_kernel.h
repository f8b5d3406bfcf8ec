// The kernel behind a joystick's event file, for a program in another process with mock_event preloaded.
#pragma once

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "device/evdev/fake_event_device.h"

namespace hapticd::whole_server {

/// One program at a time. As Linux does, it ends all effects of a program that closes the file or dies.
class EventKernel {
 public:
  /// Makes the "file" and a second one beside it.
  EventKernel(const std::string& file, device::FakeJoystick& joystick);
  ~EventKernel();
  EventKernel(const EventKernel&) = delete;
  EventKernel& operator=(const EventKernel&) = delete;

  /// -1 … 1 from left to right and from away to the user; felt by the program in its next read.
  void move(double x, double z);
  /// The cable is out: everything fails, and the file says that the device is gone.
  void unplug();
  /// A new device under the same name.
  void plugIn();
  int opened() const { return opened_; }

 private:
  void run();
  void accept();
  void answer();
  void obey();
  void forget();

  device::FakeJoystick& joystick_;
  device::FakeEventDevice device_;
  int fileListener_ = -1;
  int ioctlListener_ = -1;
  int stop_ = -1;
  std::atomic<int> file_{-1};
  int ioctls_ = -1;
  std::atomic<int> opened_{0};
  std::vector<unsigned char> half_;  // of an event
  std::mutex mutex_;
  std::thread thread_;
};

}  // namespace hapticd::whole_server
