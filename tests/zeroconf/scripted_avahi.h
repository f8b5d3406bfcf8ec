// A message bus with an Avahi daemon that does what a test tells it.
#pragma once

#include <sys/types.h>
#include <systemd/sd-bus.h>

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace hapticd::test {

/// A dbus-daemon of its own, at which DBUS_SYSTEM_BUS_ADDRESS points while it exists.
class PrivateBus {
 public:
  PrivateBus();
  ~PrivateBus();
  /// False without a dbus-daemon.
  bool runs() const { return pid_ > 0; }

 private:
  pid_t pid_ = -1;
};

struct AvahiEntry {
  int interface, protocol;
  std::string name, type;
  std::uint16_t port;
  std::vector<std::string> text;
};

/// Owns org.freedesktop.Avahi on the bus while it exists. Its methods may be called from the test's thread.
class ScriptedAvahi {
 public:
  /// `taken`: names that it refuses at once, as those of another program of the same machine.
  explicit ScriptedAvahi(std::vector<std::string> taken = {});
  ~ScriptedAvahi();

  /// Waits until this number of entry groups has been committed; false after a time that only a hang can
  /// take.
  bool waitCommitted(std::size_t count);
  /// The entry of the last commit.
  AvahiEntry entry();
  /// Tells the announcer that another machine has the name.
  void collide();
  /// Tells that the daemon runs under another host name; it has dropped all entries.
  void renameHost();
  /// What browsers are told, from then on: each entry once, with an address; those of protocol -1 cannot be
  /// resolved.
  void setOthers(std::vector<std::pair<AvahiEntry, std::string>> others);

 private:
  static int onCall(sd_bus_message* call, void* self, sd_bus_error* error);
  int answer(sd_bus_message* call);
  int addService(sd_bus_message* call);
  int browse(sd_bus_message* call);
  int resolve(sd_bus_message* call);
  void run();

  sd_bus* bus_ = nullptr;
  std::vector<std::string> taken_;
  std::mutex mutex_;  // all below
  std::condition_variable changed_;
  std::vector<std::function<void()>> orders_;
  AvahiEntry added_{}, committed_{};
  std::size_t commits_ = 0;
  std::vector<std::pair<AvahiEntry, std::string>> others_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace hapticd::test
