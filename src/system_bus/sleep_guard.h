// No machine goes to sleep with a force on a hand.
#pragma once

#include <functional>

#include "base/thread.h"

namespace hapticd::system_bus {

/// Asks logind not to suspend the machine while forces are armed, if it lets this user ask, and in any case
/// to wait until they have ended. Without a bus or logind it does nothing and tries again. A thread of its
/// own waits for the bus; nothing waits for that thread but the destructor.
class SleepGuard {
 public:
  /// `armed`: whether a hand may feel a force now; asked four times a second. `stopForces`: ends them and
  /// waits until they have ended. Both are called in the guard's thread.
  SleepGuard(std::function<bool()> armed, std::function<void()> stopForces);
  ~SleepGuard();
  SleepGuard(const SleepGuard&) = delete;
  SleepGuard& operator=(const SleepGuard&) = delete;

 private:
  void run();

  std::function<bool()> armed_;
  std::function<void()> stopForces_;
  int stopFd_;
  base::BlockingThread thread_;
};

}  // namespace hapticd::system_bus
