// The Avahi daemon over the system's message bus.
#pragma once

#include <systemd/sd-bus.h>

#include <memory>
#include <stdexcept>
#include <string>

namespace hapticd::zeroconf {

/// There is no bus, no Avahi on it, or it refused; what() is a sentence with the remedy, where there is one.
class Unavailable : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

inline constexpr const char* kAvahi = "org.freedesktop.Avahi";
inline constexpr const char* kAvahiServer = "org.freedesktop.Avahi.Server";
inline constexpr const char* kAvahiGroup = "org.freedesktop.Avahi.EntryGroup";
inline constexpr const char* kAvahiBrowser = "org.freedesktop.Avahi.ServiceBrowser";

inline constexpr int kAnyInterface = -1;
inline constexpr int kIpv4 = 0;  // the server listens on IPv4 alone

struct BusDeleter {
  void operator()(sd_bus* bus) const noexcept { sd_bus_flush_close_unref(bus); }
};
struct MessageDeleter {
  void operator()(sd_bus_message* message) const noexcept { sd_bus_message_unref(message); }
};
using Message = std::unique_ptr<sd_bus_message, MessageDeleter>;

/// A connection to the system's bus. One thread.
class Avahi {
 public:
  /// Throws Unavailable without a bus.
  Avahi();

  sd_bus* bus() const noexcept { return bus_.get(); }
  /// Calls a method of Avahi and waits for its answer, 2 s at most. Throws Unavailable; a name that is taken
  /// is returned as an empty answer.
  Message call(const char* path, const char* interface, const char* method, const char* types, ...);
  /// As call(), with a message.
  Message send(sd_bus_message* request);
  /// From now on `handler` is called for this signal of Avahi, in process().
  void onSignal(const char* interface, const char* signal, sd_bus_message_handler_t handler, void* context);
  /// As onSignal(), whenever Avahi starts or ends.
  void onOwnerChange(sd_bus_message_handler_t handler, void* context);
  /// Handles what has arrived. Throws Unavailable when the bus is gone.
  void process();
  /// Waits for work of process() or, if not -1, for `wakeFd` to be readable, at most `timeout_ms` (-1: for
  /// ever).
  void wait(int wakeFd, int timeout_ms);

 private:
  std::unique_ptr<sd_bus, BusDeleter> bus_;
};

}  // namespace hapticd::zeroconf
