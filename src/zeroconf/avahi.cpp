#include "zeroconf/avahi.h"

#include <cstdarg>
#include <string_view>

namespace hapticd::zeroconf {

Message Avahi::call(const char* path, const char* interface, const char* method, const char* types, ...) {
  const Message request = bus_.makeCall(kAvahi, path, interface, method);
  va_list arguments;
  va_start(arguments, types);
  const int result = sd_bus_message_appendv(request.get(), types, arguments);
  va_end(arguments);
  if (result < 0) throw Unavailable(std::string("the arguments of ") + method + " could not be sent");
  return send(request.get());
}

Message Avahi::send(sd_bus_message* request) {
  system_bus::Reply reply = bus_.call(request);
  if (reply.message) return std::move(reply.message);
  if (reply.error == "org.freedesktop.Avahi.CollisionError") return nullptr;
  // All others come from the bus, which starts the daemon when it can.
  if (reply.error.rfind(kAvahi, 0) != 0)
    throw Unavailable("the Avahi daemon does not run (" + reply.reason +
                      "): install it by 'apt install avahi-daemon'");
  throw Unavailable(std::string("the Avahi daemon refused ") + sd_bus_message_get_member(request) + ": " +
                    reply.reason);
}

}  // namespace hapticd::zeroconf
