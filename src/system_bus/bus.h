// The system's message bus (D-Bus), by sd-bus.
#pragma once

#include <systemd/sd-bus.h>

#include <memory>
#include <stdexcept>
#include <string>

namespace hapticd::system_bus {

/// There is no bus, or no answer on it, or the service refused; what() is a sentence with the remedy, where
/// there is one.
class Unavailable : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct BusDeleter {
  void operator()(sd_bus* bus) const noexcept { sd_bus_close_unref(bus); }
};
struct MessageDeleter {
  void operator()(sd_bus_message* message) const noexcept { sd_bus_message_unref(message); }
};
using Message = std::unique_ptr<sd_bus_message, MessageDeleter>;

/// The answer to a call, or the error.
struct Reply {
  Message message;     ///< null after an error
  std::string error;   ///< "org.freedesktop.DBus.Error.AccessDenied"; may be empty
  std::string reason;  ///< in words
};

inline constexpr int kNoFd = -1;

/// A connection to the bus. One thread. No call waits longer than 2 s.
class Bus {
 public:
  /// Waits until the bus has answered, or `wakeFd` (kNoFd: none) is readable; the bus may then be unready,
  /// and calls fail. Throws Unavailable.
  explicit Bus(int wakeFd);

  sd_bus* get() const noexcept { return bus_.get(); }
  /// A call to be filled with arguments and passed to call(). Throws Unavailable.
  Message makeCall(const char* service, const char* path, const char* interface, const char* method);
  /// Calls and waits for the answer.
  Reply call(sd_bus_message* request);
  /// From now on `handler` is called for this signal, in process(). Throws Unavailable.
  void onSignal(const char* service, const char* interface, const char* signal,
                sd_bus_message_handler_t handler, void* context);
  /// As onSignal(), whenever the service starts or ends.
  void onOwnerChange(const char* service, sd_bus_message_handler_t handler, void* context);
  /// Handles what has arrived. Throws Unavailable when the bus is gone.
  void process();
  /// Waits for work of process() or, if not kNoFd, for `wakeFd` to be readable, at most `timeout_ms` (-1: for
  /// ever).
  void wait(int wakeFd, int timeout_ms);

 private:
  std::unique_ptr<sd_bus, BusDeleter> bus_;
};

}  // namespace hapticd::system_bus
