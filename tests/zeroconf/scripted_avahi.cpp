#include "zeroconf/scripted_avahi.h"

#include <algorithm>
#include <chrono>
#include <string_view>
#include <utility>

namespace hapticd::test {
namespace {

constexpr const char* kName = "org.freedesktop.Avahi";
constexpr const char* kGroup = "/Client0/EntryGroup1";
constexpr const char* kBrowser = "/Client0/ServiceBrowser1";

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

ScriptedAvahi::ScriptedAvahi(std::vector<std::string> taken)
    : ScriptedService(kName, {"/", kGroup}), taken_(std::move(taken)) {
  begin();
}

ScriptedAvahi::~ScriptedAvahi() {
  finish();
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
  order([this] {
    sd_bus_emit_signal(bus_, kGroup, "org.freedesktop.Avahi.EntryGroup", "StateChanged", "is", kCollision,
                       "");
  });
}

void ScriptedAvahi::renameHost() {
  constexpr int kRunning = 2;
  order([this] {
    sd_bus_emit_signal(bus_, "/", "org.freedesktop.Avahi.Server", "StateChanged", "is", kRunning, "");
  });
}

void ScriptedAvahi::setOthers(std::vector<std::pair<AvahiEntry, std::string>> others) {
  const std::lock_guard lock(mutex_);
  others_ = std::move(others);
}

bool ScriptedAvahi::waitBrowsed() {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, std::chrono::seconds(30), [&] { return browsed_; });
}

void ScriptedAvahi::neverFinish() {
  const std::lock_guard lock(mutex_);
  neverFinishes_ = true;
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
  browsed_ = true;
  changed_.notify_all();
  // As Avahi does, some are told before the answer that names the browser.
  const char* const from = "org.freedesktop.Avahi.ServiceBrowser";
  for (const auto& [entry, address] : others_) {
    if (entry.type != wanted) continue;
    sd_bus_emit_signal(bus_, kBrowser, from, "ItemNew", "iisssu", entry.interface, entry.protocol,
                       entry.name.c_str(), entry.type.c_str(), "local", 0U);
  }
  const int result = sd_bus_reply_method_return(call, "o", kBrowser);
  if (!neverFinishes_) sd_bus_emit_signal(bus_, kBrowser, from, "AllForNow", "");
  return result;
}

int ScriptedAvahi::resolve(sd_bus_message* call) {
  int interface = 0;
  int protocol = 0;
  const char* name = "";
  sd_bus_message_read(call, "iis", &interface, &protocol, &name);
  for (const auto& [entry, address] : others_) {
    if (entry.name != name || entry.interface != interface || entry.protocol < 0) continue;
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
