#include "system_bus/scripted_logind.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <string_view>
#include <utility>

namespace hapticd::test {
namespace {

constexpr const char* kPath = "/org/freedesktop/login1";
constexpr const char* kManager = "org.freedesktop.login1.Manager";

}  // namespace

ScriptedLogind::ScriptedLogind(std::set<std::string> refused)
    : ScriptedService("org.freedesktop.login1", {kPath}), refused_(std::move(refused)) {
  begin();
}

ScriptedLogind::~ScriptedLogind() {
  finish();
  for (const Lock& lock : locks_) ::close(lock.fd);
}

bool ScriptedLogind::waitHeld(const std::set<std::string>& modes) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (held() != modes) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

void ScriptedLogind::refuseNothing() {
  const std::lock_guard lock(mutex_);
  refused_.clear();
}

bool ScriptedLogind::waitRefusals(int count) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  for (;;) {
    {
      const std::lock_guard lock(mutex_);
      if (refusals_ >= count) return true;
    }
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

void ScriptedLogind::announceSleep(bool begins) {
  order([this, begins] {
    sd_bus_emit_signal(bus_, kPath, kManager, "PrepareForSleep", "b", static_cast<int>(begins));
  });
}

std::string ScriptedLogind::lastRequest() {
  const std::lock_guard lock(mutex_);
  return lastRequest_;
}

std::set<std::string> ScriptedLogind::held() {
  const std::lock_guard lock(mutex_);
  std::set<std::string> modes;
  for (const Lock& given : locks_) {
    pollfd end{given.fd, 0, 0};
    if (::poll(&end, 1, 0) == 0) modes.insert(given.mode);
  }
  return modes;
}

int ScriptedLogind::answer(sd_bus_message* call) {
  if (std::string_view(sd_bus_message_get_member(call)) != "Inhibit") return 0;
  const char *what = "", *who = "", *why = "", *mode = "";
  sd_bus_message_read(call, "ssss", &what, &who, &why, &mode);
  lastRequest_ = std::string(what) + ' ' + who;
  if (refused_.count(mode) != 0) {
    ++refusals_;
    return sd_bus_reply_method_errorf(call, "org.freedesktop.DBus.Error.AccessDenied", "Permission denied");
  }
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return -1;
  locks_.push_back({mode, ends[0]});
  const int result = sd_bus_reply_method_return(call, "h", ends[1]);
  ::close(ends[1]);
  return result;
}

}  // namespace hapticd::test
