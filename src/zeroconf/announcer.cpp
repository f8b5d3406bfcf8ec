#include "zeroconf/announcer.h"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <string_view>
#include <utility>

#include "base/world.h"
#include "zeroconf/avahi.h"
#include "zeroconf/interfaces.h"

namespace hapticd::zeroconf {
namespace {

// States of an entry group.
constexpr int kEstablished = 2;
constexpr int kCollision = 3;
constexpr int kFailure = 4;

constexpr int kLongestRetry_ms = 60'000;

/// The server's entry at the daemon of one bus, made again whenever the daemon starts.
class Entry {
 public:
  Entry(Avahi& avahi, AnnouncedServer& server, int interface)
      : avahi_(avahi), server_(server), interface_(interface) {
    avahi_.onSignal(kAvahiGroup, "StateChanged", onState, this);
    avahi_.onSignal(kAvahiServer, "StateChanged", onServer, this);
    avahi_.onOwnerChange(onOwner, this);
  }

  /// Does what the signals asked for; not in their handlers, which must not call back. Returns the time in
  /// milliseconds after which it must be called again, -1 for never.
  int update() {
    constexpr base::Nanos kRetry = 10'000'000'000;
    if (std::exchange(failed_, false)) retryAt_ = base::now() + kRetry;
    if (retryAt_ != 0 && base::now() >= retryAt_) due_ = true;
    if (std::exchange(due_, false)) {
      retryAt_ = 0;
      try {
        if (std::exchange(renamed_, false)) rename();
        publish();
      } catch (const Unavailable& reason) {
        group_.clear();
        if (!std::exchange(reported_, true)) spdlog::info("not announced on the network: {}", reason.what());
        retryAt_ = base::now() + kRetry;
      }
    }
    return retryAt_ == 0 ? -1
                         : static_cast<int>(std::max<base::Nanos>(retryAt_ - base::now(), 0) / 1'000'000) + 1;
  }

 private:
  void publish() {
    if (group_.empty()) {
      const char* path = "";
      const Message answer = avahi_.call("/", kAvahiServer, "EntryGroupNew", "");
      sd_bus_message_read(answer.get(), "o", &path);
      group_ = path;
    } else {
      avahi_.call(group_.c_str(), kAvahiGroup, "Reset", "");
    }
    while (!addService()) rename();
    avahi_.call(group_.c_str(), kAvahiGroup, "Commit", "");
  }

  // False when the name is taken on this machine.
  bool addService() {
    const Message request = avahi_.bus().makeCall(kAvahi, group_.c_str(), kAvahiGroup, "AddService");
    sd_bus_message* const raw = request.get();
    sd_bus_message_append(raw, "iiussssq", interface_, kIpv4, 0U, server_.name.c_str(), kServiceType, "", "",
                          static_cast<unsigned>(server_.port));
    sd_bus_message_open_container(raw, 'a', "ay");
    for (const std::string& entry : server_.text())
      sd_bus_message_append_array(raw, 'y', entry.data(), entry.size());
    sd_bus_message_close_container(raw);
    return avahi_.send(raw) != nullptr;
  }

  void rename() {
    const Message answer =
        avahi_.call("/", kAvahiServer, "GetAlternativeServiceName", "s", server_.name.c_str());
    const char* name = "";
    sd_bus_message_read(answer.get(), "s", &name);
    spdlog::info("'{}' is taken on the network: announced as '{}'", server_.name, name);
    server_.name = name;
  }

  static int onState(sd_bus_message* signal, void* self, sd_bus_error*) noexcept {
    auto& entry = *static_cast<Entry*>(self);
    if (entry.group_ != std::string_view(sd_bus_message_get_path(signal))) return 0;
    int state = 0;
    sd_bus_message_read(signal, "i", &state);
    if (state == kEstablished) {
      spdlog::info("announced on the network as '{}'", entry.server_.name);
      entry.reported_ = false;
    }
    if (state == kFailure) {
      if (!std::exchange(entry.reported_, true))
        spdlog::warn("the Avahi daemon cannot announce '{}'", entry.server_.name);
      entry.failed_ = true;
    }
    if (state == kCollision) entry.due_ = entry.renamed_ = true;
    return 0;
  }
  // After a new host name the daemon runs again, without its entries.
  static int onServer(sd_bus_message* signal, void* self, sd_bus_error*) noexcept {
    constexpr int kRunning = 2;
    int state = 0;
    sd_bus_message_read(signal, "i", &state);
    if (state == kRunning) static_cast<Entry*>(self)->due_ = true;
    return 0;
  }
  static int onOwner(sd_bus_message* signal, void* self, sd_bus_error*) noexcept {
    auto& entry = *static_cast<Entry*>(self);
    const char* owner = "";
    sd_bus_message_skip(signal, "ss");
    sd_bus_message_read(signal, "s", &owner);
    entry.group_.clear();
    entry.due_ = *owner != '\0';
    entry.retryAt_ = 0;
    return 0;
  }

  Avahi& avahi_;
  AnnouncedServer& server_;
  int interface_;
  std::string group_;  // its object path at the present daemon
  bool due_ = true;
  bool renamed_ = false;
  bool failed_ = false;
  bool reported_ = false;    // that it is not announced
  base::Nanos retryAt_ = 0;  // 0: not needed
};

}  // namespace

Announcer::Announcer(AnnouncedServer server, std::uint32_t address)
    : server_(std::move(server)),
      interface_(interfaceWith(address)),
      stopFd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  thread_ = base::BlockingThread({.name = "announce", .niceness = 10}, [this] { run(); });
}

Announcer::~Announcer() {
  ::eventfd_write(stopFd_, 1);
  thread_.join();
  ::close(stopFd_);
}

void Announcer::run() {
  int retry_ms = 1000;
  bool reported = false;
  eventfd_t stop = 0;
  while (::eventfd_read(stopFd_, &stop) != 0) {
    try {
      system_bus::Bus bus(stopFd_);
      Avahi avahi(bus);
      Entry entry(avahi, server_, interface_);
      while (::eventfd_read(stopFd_, &stop) != 0) {
        bus.process();
        bus.wait(stopFd_, entry.update());
      }
      return;
    } catch (const Unavailable& reason) {
      if (!std::exchange(reported, true)) spdlog::info("not announced on the network: {}", reason.what());
    }
    pollfd wake{stopFd_, POLLIN, 0};
    ::poll(&wake, 1, retry_ms);
    retry_ms = std::min(2 * retry_ms, kLongestRetry_ms);
  }
}

}  // namespace hapticd::zeroconf
