#include "zeroconf/scripted_avahi.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace hapticd::test {
namespace {

constexpr const char* kName = "org.freedesktop.Avahi";
constexpr const char* kGroup = "/Client0/EntryGroup1";
constexpr const char* kBrowser = "/Client0/ServiceBrowser1";

void check(int result, const char* what) {
  if (result < 0) throw std::runtime_error(std::string(what) + ": " + std::strerror(-result));
}

std::vector<std::string> readText(sd_bus_message* call) {
  std::vector<std::string> text;
  sd_bus_message_enter_container(call, 'a', "ay");
  const void* bytes = nullptr;
  std::size_t size = 0;
  while (sd_bus_message_read_array(call, 'y', &bytes, &size) > 0)
    text.emplace_back(static_cast<const char*>(bytes), size);
  return text;
}

}  // namespace

PrivateBus::PrivateBus() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], 3);
  // Its complaint about limits of rights that it has not; and no pipe of ours outlives this program in it.
  for (const int output : {1, 2})
    posix_spawn_file_actions_addopen(&actions, output, "/dev/null", O_WRONLY, 0);
  std::array<const char*, 6> arguments{"dbus-daemon", "--session",         "--nofork",
                                       "--nopidfile", "--print-address=3", nullptr};
  if (::posix_spawnp(&pid_, arguments[0], &actions, nullptr, const_cast<char* const*>(arguments.data()),
                     environ) != 0)
    pid_ = -1;
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  std::string address;
  for (char c = 0; ::read(ends[0], &c, 1) == 1 && c != '\n';) address += c;
  ::close(ends[0]);
  if (runs()) ::setenv("DBUS_SYSTEM_BUS_ADDRESS", address.c_str(), 1);
}

PrivateBus::~PrivateBus() {
  if (!runs()) return;
  ::unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
  ::kill(pid_, SIGTERM);
  ::waitpid(pid_, nullptr, 0);
}

ScriptedAvahi::ScriptedAvahi(std::vector<std::string> taken) : taken_(std::move(taken)) {
  check(sd_bus_open_system(&bus_), "bus");
  for (const char* path : {"/", kGroup}) check(sd_bus_add_object(bus_, nullptr, path, onCall, this), path);
  check(sd_bus_request_name(bus_, kName, 0), kName);
  thread_ = std::thread([this] { run(); });
}

ScriptedAvahi::~ScriptedAvahi() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  thread_.join();
  sd_bus_flush_close_unref(bus_);
}

void ScriptedAvahi::run() {
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      if (ending_) return;
      for (const auto& order : std::exchange(orders_, {})) order();
    }
    if (sd_bus_process(bus_, nullptr) > 0) continue;
    constexpr std::uint64_t kTurn_us = 5'000;
    sd_bus_wait(bus_, kTurn_us);
  }
}

bool ScriptedAvahi::waitCommitted(std::size_t count) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, std::chrono::seconds(30), [&] { return commits_ >= count; });
}

AvahiEntry ScriptedAvahi::entry() {
  const std::lock_guard lock(mutex_);
  return committed_;
}

void ScriptedAvahi::collide() {
  constexpr int kCollision = 3;
  const std::lock_guard lock(mutex_);
  orders_.emplace_back([this] {
    sd_bus_emit_signal(bus_, kGroup, "org.freedesktop.Avahi.EntryGroup", "StateChanged", "is", kCollision,
                       "");
  });
}

void ScriptedAvahi::renameHost() {
  constexpr int kRunning = 2;
  const std::lock_guard lock(mutex_);
  orders_.emplace_back([this] {
    sd_bus_emit_signal(bus_, "/", "org.freedesktop.Avahi.Server", "StateChanged", "is", kRunning, "");
  });
}

void ScriptedAvahi::setOthers(std::vector<std::pair<AvahiEntry, std::string>> others) {
  const std::lock_guard lock(mutex_);
  others_ = std::move(others);
}

int ScriptedAvahi::onCall(sd_bus_message* call, void* self, sd_bus_error*) {
  auto& avahi = *static_cast<ScriptedAvahi*>(self);
  const std::lock_guard lock(avahi.mutex_);
  return avahi.answer(call);
}

int ScriptedAvahi::answer(sd_bus_message* call) {
  const char* const name = sd_bus_message_get_member(call);
  const std::string_view method = name != nullptr ? name : "";
  if (method == "EntryGroupNew") return sd_bus_reply_method_return(call, "o", kGroup);
  if (method == "AddService") return addService(call);
  if (method == "Reset") return sd_bus_reply_method_return(call, "");
  if (method == "ServiceBrowserNew") return browse(call);
  if (method == "ResolveService") return resolve(call);
  if (method == "Commit") {
    committed_ = added_;
    ++commits_;
    changed_.notify_all();
    return sd_bus_reply_method_return(call, "");
  }
  if (method == "GetAlternativeServiceName") {
    const char* taken = "";
    sd_bus_message_read(call, "s", &taken);
    return sd_bus_reply_method_return(call, "s", (std::string(taken) + " #2").c_str());
  }
  return 0;
}

int ScriptedAvahi::addService(sd_bus_message* call) {
  const char *name = "", *type = "", *domain = "", *host = "";
  std::uint32_t flags = 0;
  added_ = {};
  sd_bus_message_read(call, "iiussssq", &added_.interface, &added_.protocol, &flags, &name, &type, &domain,
                      &host, &added_.port);
  added_.name = name;
  added_.type = type;
  added_.text = readText(call);
  if (std::count(taken_.begin(), taken_.end(), added_.name) != 0)
    return sd_bus_reply_method_errorf(call, "org.freedesktop.Avahi.CollisionError", "Local name collision");
  return sd_bus_reply_method_return(call, "");
}

int ScriptedAvahi::browse(sd_bus_message* call) {
  int interface = 0;
  int protocol = 0;
  const char* type = "";
  sd_bus_message_read(call, "iis", &interface, &protocol, &type);
  const std::string wanted = type;
  // As Avahi does, some are told before the answer that names the browser.
  const char* const from = "org.freedesktop.Avahi.ServiceBrowser";
  for (const auto& [entry, address] : others_) {
    if (entry.type != wanted) continue;
    sd_bus_emit_signal(bus_, kBrowser, from, "ItemNew", "iisssu", entry.interface, entry.protocol,
                       entry.name.c_str(), entry.type.c_str(), "local", 0U);
  }
  const int result = sd_bus_reply_method_return(call, "o", kBrowser);
  sd_bus_emit_signal(bus_, kBrowser, from, "AllForNow", "");
  return result;
}

int ScriptedAvahi::resolve(sd_bus_message* call) {
  int interface = 0;
  int protocol = 0;
  const char* name = "";
  sd_bus_message_read(call, "iis", &interface, &protocol, &name);
  for (const auto& [entry, address] : others_) {
    if (entry.name != name || entry.protocol < 0) continue;
    sd_bus_message* reply = nullptr;
    sd_bus_message_new_method_return(call, &reply);
    sd_bus_message_append(reply, "iissssisq", interface, protocol, name, entry.type.c_str(), "local",
                          "lab7.local", 0, address.c_str(), static_cast<unsigned>(entry.port));
    sd_bus_message_open_container(reply, 'a', "ay");
    for (const std::string& text : entry.text)
      sd_bus_message_append_array(reply, 'y', text.data(), text.size());
    sd_bus_message_close_container(reply);
    sd_bus_message_append(reply, "u", 0U);
    const int result = sd_bus_send(bus_, reply, nullptr);
    sd_bus_message_unref(reply);
    return result;
  }
  return sd_bus_reply_method_errorf(call, "org.freedesktop.Avahi.TimeoutError", "Timeout reached");
}

}  // namespace hapticd::test
