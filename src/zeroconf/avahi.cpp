#include "zeroconf/avahi.h"

#include <poll.h>

#include <array>
#include <cstdarg>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace hapticd::zeroconf {
namespace {

[[noreturn]] void fail(const char* what, int result) {
  throw Unavailable(std::string(what) + ": " + std::strerror(-result));
}

struct Error {
  sd_bus_error error{};
  ~Error() { sd_bus_error_free(&error); }
};

}  // namespace

Avahi::Avahi() {
  sd_bus* bus = nullptr;
  const int result = sd_bus_open_system(&bus);
  if (result < 0) fail("no system bus (D-Bus), by which the Avahi daemon is asked", result);
  bus_.reset(bus);
}

Message Avahi::call(const char* path, const char* interface, const char* method, const char* types, ...) {
  sd_bus_message* raw = nullptr;
  int result = sd_bus_message_new_method_call(bus(), &raw, kAvahi, path, interface, method);
  const Message request(raw);
  va_list arguments;
  va_start(arguments, types);
  if (result >= 0) result = sd_bus_message_appendv(raw, types, arguments);
  va_end(arguments);
  if (result < 0) fail("a message to the Avahi daemon could not be made", result);
  return send(raw);
}

Message Avahi::send(sd_bus_message* request) {
  constexpr std::uint64_t kPatience_us = 2'000'000;
  Error failure;
  sd_bus_message* answer = nullptr;
  const int result = sd_bus_call(bus(), request, kPatience_us, &failure.error, &answer);
  if (result >= 0) return Message(answer);
  const std::string_view name = failure.error.name != nullptr ? failure.error.name : "";
  const std::string text = failure.error.message != nullptr ? failure.error.message : std::strerror(-result);
  if (name == "org.freedesktop.Avahi.CollisionError") return nullptr;
  // All others come from the bus, which starts the daemon when it can.
  if (name.rfind(kAvahi, 0) != 0)
    throw Unavailable("the Avahi daemon does not run (" + text +
                      "): install it by 'apt install avahi-daemon'");
  throw Unavailable(std::string("the Avahi daemon refused ") + sd_bus_message_get_member(request) + ": " +
                    text);
}

void Avahi::onSignal(const char* interface, const char* signal, sd_bus_message_handler_t handler,
                     void* context) {
  const int result =
      sd_bus_match_signal(bus(), nullptr, kAvahi, nullptr, interface, signal, handler, context);
  if (result < 0) fail("the system bus refused a subscription", result);
}

void Avahi::onOwnerChange(sd_bus_message_handler_t handler, void* context) {
  const int result =
      sd_bus_add_match(bus(), nullptr,
                       "type='signal',sender='org.freedesktop.DBus',interface='org.freedesktop.DBus',"
                       "member='NameOwnerChanged',arg0='org.freedesktop.Avahi'",
                       handler, context);
  if (result < 0) fail("the system bus refused a subscription", result);
}

void Avahi::process() {
  int result = 1;
  while (result > 0) result = sd_bus_process(bus(), nullptr);
  if (result < 0) fail("the system bus is gone", result);
}

void Avahi::wait(int wakeFd, int timeout_ms) {
  // Messages that arrived during a call are read already: they wait without traffic of the bus.
  std::uint64_t due_us = 0;
  if (sd_bus_get_timeout(bus(), &due_us) > 0 && due_us == 0) return;
  std::array<pollfd, 2> waits{{{sd_bus_get_fd(bus()), POLLIN, 0}, {wakeFd, POLLIN, 0}}};
  waits[0].events = static_cast<short>(sd_bus_get_events(bus()));
  ::poll(waits.data(), waits.size(), timeout_ms);
}

}  // namespace hapticd::zeroconf
