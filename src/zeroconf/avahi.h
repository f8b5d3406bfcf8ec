// The Avahi daemon over the system's message bus.
#pragma once

#include <string>

#include "system_bus/bus.h"

namespace hapticd::zeroconf {

using system_bus::Message;
using system_bus::Unavailable;

inline constexpr const char* kAvahi = "org.freedesktop.Avahi";
inline constexpr const char* kAvahiServer = "org.freedesktop.Avahi.Server";
inline constexpr const char* kAvahiGroup = "org.freedesktop.Avahi.EntryGroup";
inline constexpr const char* kAvahiBrowser = "org.freedesktop.Avahi.ServiceBrowser";

inline constexpr int kAnyInterface = -1;
inline constexpr int kIpv4 = 0;  // the server listens on IPv4 alone

/// The answers of Avahi on a bus that outlives it. One thread.
class Avahi {
 public:
  explicit Avahi(system_bus::Bus& bus) : bus_(bus) {}

  system_bus::Bus& bus() const noexcept { return bus_; }
  /// Calls a method of Avahi and waits for its answer, 2 s at most. Throws Unavailable; a name that is taken
  /// is returned as an empty answer.
  Message call(const char* path, const char* interface, const char* method, const char* types, ...);
  /// As call(), with a message.
  Message send(sd_bus_message* request);
  /// From now on `handler` is called for this signal of Avahi, in Bus::process().
  void onSignal(const char* interface, const char* signal, sd_bus_message_handler_t handler, void* context) {
    bus_.onSignal(kAvahi, interface, signal, handler, context);
  }
  /// As onSignal(), whenever Avahi starts or ends.
  void onOwnerChange(sd_bus_message_handler_t handler, void* context) {
    bus_.onOwnerChange(kAvahi, handler, context);
  }

 private:
  system_bus::Bus& bus_;
};

}  // namespace hapticd::zeroconf
