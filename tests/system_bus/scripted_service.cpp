#include "system_bus/scripted_service.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace hapticd::test {
namespace {

void check(int result, const char* what) {
  if (result < 0) throw std::runtime_error(std::string(what) + ": " + std::strerror(-result));
}

}  // namespace

PrivateBus::PrivateBus() {
  start("");
}

PrivateBus::~PrivateBus() {
  end();
}

void PrivateBus::restart() {
  end();
  start(address_.substr(0, address_.find(",guid=")));
}

void PrivateBus::start(const std::string& at) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], 3);
  // Its complaint about limits of rights that it has not; and no pipe of ours outlives this program in it.
  for (const int output : {1, 2})
    posix_spawn_file_actions_addopen(&actions, output, "/dev/null", O_WRONLY, 0);
  const std::string address = "--address=" + at;
  std::vector<const char*> arguments{"dbus-daemon", "--session", "--nofork", "--nopidfile",
                                     "--print-address=3"};
  if (!at.empty()) arguments.push_back(address.c_str());
  arguments.push_back(nullptr);
  if (::posix_spawnp(&pid_, arguments[0], &actions, nullptr, const_cast<char* const*>(arguments.data()),
                     environ) != 0)
    pid_ = -1;
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  address_.clear();
  for (char c = 0; ::read(ends[0], &c, 1) == 1 && c != '\n';) address_ += c;
  ::close(ends[0]);
  if (runs()) ::setenv("DBUS_SYSTEM_BUS_ADDRESS", address_.c_str(), 1);
}

void PrivateBus::end() {
  if (!runs()) return;
  ::unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
  ::kill(pid_, SIGTERM);
  ::waitpid(std::exchange(pid_, -1), nullptr, 0);
}

ScriptedService::ScriptedService(const char* name, const std::vector<const char*>& paths) {
  check(sd_bus_open_system(&bus_), "bus");
  for (const char* path : paths) check(sd_bus_add_object(bus_, nullptr, path, onCall, this), path);
  check(sd_bus_request_name(bus_, name, 0), name);
}

ScriptedService::~ScriptedService() {
  sd_bus_flush_close_unref(bus_);
}

void ScriptedService::begin() {
  thread_ = std::thread([this] { run(); });
}

void ScriptedService::finish() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  thread_.join();
}

void ScriptedService::order(std::function<void()> function) {
  const std::lock_guard lock(mutex_);
  orders_.push_back(std::move(function));
}

int ScriptedService::onCall(sd_bus_message* call, void* self, sd_bus_error*) {
  auto& service = *static_cast<ScriptedService*>(self);
  const std::lock_guard lock(service.mutex_);
  return service.answer(call);
}

void ScriptedService::run() {
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      if (ending_) return;
      for (const auto& order : std::exchange(orders_, {})) order();
    }
    const int result = sd_bus_process(bus_, nullptr);
    if (result > 0) continue;
    constexpr std::uint64_t kTurn_us = 5'000;
    if (result < 0) std::this_thread::sleep_for(std::chrono::microseconds(kTurn_us));  // the bus is gone
    sd_bus_wait(bus_, kTurn_us);
  }
}

}  // namespace hapticd::test
