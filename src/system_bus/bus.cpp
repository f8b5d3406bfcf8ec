#include "system_bus/bus.h"

#include <poll.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <string>

namespace hapticd::system_bus {
namespace {

constexpr int kPatience_ms = 2000;

[[noreturn]] void fail(const std::string& what, int result) {
  throw Unavailable(what + ": " + std::strerror(-result));
}

void check(const char* what, int result) {
  if (result < 0) fail(what, result);
}

}  // namespace

Bus::Bus(int wakeFd) {
  sd_bus* bus = nullptr;
  const int opened = sd_bus_open_system(&bus);
  if (opened < 0)
    throw Unavailable(std::string("no system bus (D-Bus): ") + std::strerror(-opened) +
                      "; install it by 'apt install dbus'; a container needs /run/dbus of its machine");
  bus_.reset(bus);
  check("the system bus", sd_bus_set_method_call_timeout(bus, std::uint64_t{kPatience_ms} * 1000));
  constexpr int kStep_ms = 20;
  for (int waited_ms = 0; sd_bus_is_ready(bus) == 0; waited_ms += kStep_ms) {
    if (waited_ms >= kPatience_ms) throw Unavailable("the system bus (D-Bus) does not answer");
    process();
    wait(wakeFd, kStep_ms);
    pollfd wake{wakeFd, POLLIN, 0};
    if (::poll(&wake, 1, 0) > 0) return;
  }
}

Message Bus::makeCall(const char* service, const char* path, const char* interface, const char* method) {
  sd_bus_message* call = nullptr;
  check("a message to the system bus could not be made",
        sd_bus_message_new_method_call(get(), &call, service, path, interface, method));
  return Message(call);
}

Reply Bus::call(sd_bus_message* request) {
  if (sd_bus_is_ready(get()) <= 0) throw Unavailable("the system bus is not ready");
  sd_bus_error error{};
  sd_bus_message* answer = nullptr;
  const int result = sd_bus_call(get(), request, 0, &error, &answer);
  Reply reply;
  reply.message.reset(answer);
  if (result < 0) {
    reply.error = error.name != nullptr ? error.name : "";
    reply.reason = error.message != nullptr ? error.message : std::strerror(-result);
  }
  sd_bus_error_free(&error);
  return reply;
}

void Bus::onSignal(const char* service, const char* interface, const char* signal,
                   sd_bus_message_handler_t handler, void* context) {
  if (sd_bus_is_ready(get()) <= 0) throw Unavailable("the system bus is not ready");
  check("the system bus refused a subscription",
        sd_bus_match_signal(get(), nullptr, service, nullptr, interface, signal, handler, context));
}

void Bus::onOwnerChange(const char* service, sd_bus_message_handler_t handler, void* context) {
  if (sd_bus_is_ready(get()) <= 0) throw Unavailable("the system bus is not ready");
  const std::string rule =
      "type='signal',sender='org.freedesktop.DBus',interface='org.freedesktop.DBus',"
      "member='NameOwnerChanged',arg0='" +
      std::string(service) + "'";
  check("the system bus refused a subscription",
        sd_bus_add_match(get(), nullptr, rule.c_str(), handler, context));
}

void Bus::process() {
  int result = 1;
  while (result > 0) result = sd_bus_process(get(), nullptr);
  check("the system bus is gone", result);
}

void Bus::wait(int wakeFd, int timeout_ms) {
  // Messages that arrived during a call are read already: they wait without traffic of the bus.
  std::uint64_t due_us = 0;
  if (sd_bus_get_timeout(get(), &due_us) > 0 && due_us == 0) return;
  std::array<pollfd, 2> waits{{{sd_bus_get_fd(get()), POLLIN, 0}, {wakeFd, POLLIN, 0}}};
  waits[0].events = static_cast<short>(sd_bus_get_events(get()));
  ::poll(waits.data(), waits.size(), timeout_ms);
}

}  // namespace hapticd::system_bus
