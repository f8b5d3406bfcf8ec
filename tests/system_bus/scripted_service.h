// A message bus of a test's own, with services on it that do what the test tells them.
#pragma once

#include <sys/types.h>
#include <systemd/sd-bus.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace hapticd::test {

/// A dbus-daemon at which DBUS_SYSTEM_BUS_ADDRESS points while it exists.
class PrivateBus {
 public:
  PrivateBus();
  ~PrivateBus();
  /// False without a dbus-daemon.
  bool runs() const { return pid_ > 0; }
  const std::string& address() const { return address_; }
  /// Ends the daemon and starts another one at the same address.
  void restart();

 private:
  void start(const std::string& at);
  void end();

  pid_t pid_ = -1;
  std::string address_;
};

/// Owns a name on the bus while it exists. A thread of its own answers; methods may be called from the test's
/// thread.
class ScriptedService {
 public:
  ScriptedService(const ScriptedService&) = delete;
  ScriptedService& operator=(const ScriptedService&) = delete;

 protected:
  ScriptedService(const char* name, const std::vector<const char*>& paths);
  virtual ~ScriptedService();
  /// Begins to answer; the last step of a constructor.
  void begin();
  /// No answer after this; the first step of a destructor.
  void finish();
  /// Answers a call, with the mutex locked; 0: no such method.
  virtual int answer(sd_bus_message* call) = 0;
  /// Runs the function in the service's thread.
  void order(std::function<void()> function);

  sd_bus* bus_ = nullptr;
  std::mutex mutex_;
  std::condition_variable changed_;

 private:
  static int onCall(sd_bus_message* call, void* self, sd_bus_error* error);
  void run();

  std::vector<std::function<void()>> orders_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace hapticd::test
