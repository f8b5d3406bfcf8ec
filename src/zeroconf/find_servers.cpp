#include "zeroconf/find_servers.h"

#include <arpa/inet.h>
#include <poll.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>

#include "base/printable.h"
#include "zeroconf/avahi.h"
#include "zeroconf/interfaces.h"

namespace hapticd::zeroconf {
namespace {

// One search. Its handlers are called by sd-bus: what they learn stays here.
class Search {
 public:
  explicit Search(int stopFd) : stopFd_(stopFd) {
    avahi_.onSignal(kAvahiBrowser, "ItemNew", onItem, this);
    avahi_.onSignal(kAvahiBrowser, "AllForNow", onAll, this);
    avahi_.onSignal(kAvahiBrowser, "Failure", onAll, this);
    avahi_.call("/", kAvahiServer, "ServiceBrowserNew", "iissu", kAnyInterface, kIpv4, kServiceType, "", 0U);
  }

  bool finished() const { return heardAll_ && answers_ == requests_; }
  void step(int timeout_ms) {
    bus_.process();
    if (!finished()) bus_.wait(stopFd_, timeout_ms);
  }
  bool stopped() const {
    pollfd stop{stopFd_, POLLIN, 0};
    return ::poll(&stop, 1, 0) > 0;
  }
  std::vector<AnnouncedServer> found() {
    // A server is heard on each interface; those of this machine also by an address that only it can reach.
    const auto order = [](const AnnouncedServer& server) {
      return std::tuple(std::string_view(server.name), server.port, server.address.rfind("127.", 0) == 0,
                        std::string_view(server.address));
    };
    std::sort(found_.begin(), found_.end(),
              [&](const auto& a, const auto& b) { return order(a) < order(b); });
    const auto same = [](const auto& a, const auto& b) { return a.name == b.name && a.port == b.port; };
    found_.erase(std::unique(found_.begin(), found_.end(), same), found_.end());
    return std::move(found_);
  }

 private:
  static constexpr int kMost = 1000;  // more are not servers

  static int onItem(sd_bus_message* signal, void* self, sd_bus_error*) noexcept {
    auto& search = *static_cast<Search*>(self);
    if (search.requests_ == kMost) return 0;
    int interface = 0;
    int protocol = 0;
    const char *name = "", *type = "", *domain = "";
    sd_bus_message_read(signal, "iisss", &interface, &protocol, &name, &type, &domain);
    const int asked = sd_bus_call_method_async(search.bus_.get(), nullptr, kAvahi, "/", kAvahiServer,
                                               "ResolveService", onResolved, self, "iisssiu", interface,
                                               protocol, name, type, domain, kIpv4, 0U);
    if (asked >= 0) ++search.requests_;
    return 0;
  }
  static int onAll(sd_bus_message*, void* self, sd_bus_error*) noexcept {
    static_cast<Search*>(self)->heardAll_ = true;
    return 0;
  }
  // One that has left meanwhile, or whose machine does not answer, is an error: it is left out.
  static int onResolved(sd_bus_message* answer, void* self, sd_bus_error*) noexcept {
    auto& search = *static_cast<Search*>(self);
    ++search.answers_;
    if (sd_bus_message_is_method_error(answer, nullptr) > 0) return 0;
    AnnouncedServer server;
    const char *name = "", *address = "";
    sd_bus_message_skip(answer, "ii");
    sd_bus_message_read(answer, "s", &name);
    sd_bus_message_skip(answer, "sssi");
    sd_bus_message_read(answer, "sq", &address, &server.port);
    server.name = base::printable(name);
    server.address = address;
    server.read(textOf(answer));
    search.found_.push_back(server);
    return 0;
  }
  static std::vector<std::string> textOf(sd_bus_message* answer) {
    std::vector<std::string> text;
    if (sd_bus_message_enter_container(answer, 'a', "ay") <= 0) return text;
    const void* bytes = nullptr;
    std::size_t size = 0;
    while (sd_bus_message_read_array(answer, 'y', &bytes, &size) > 0)
      text.emplace_back(static_cast<const char*>(bytes), size);
    return text;
  }

  int stopFd_;
  system_bus::Bus bus_{stopFd_};
  Avahi avahi_{bus_};
  bool heardAll_ = false;
  int requests_ = 0;
  int answers_ = 0;
  std::vector<AnnouncedServer> found_;
};

}  // namespace

std::vector<AnnouncedServer> findServers(base::Clock& clock, base::Nanos patience, int stopFd) {
  Search search(stopFd);
  const base::Nanos end = clock.now() + patience;
  while (!search.finished() && !search.stopped() && clock.now() < end)
    search.step(static_cast<int>(1e3 * base::toSeconds(end - clock.now())) + 1);
  return search.found();
}

bool listensAt(const net::Endpoint& listening, const AnnouncedServer& found) {
  in_addr address{};
  if (found.port != listening.port || ::inet_pton(AF_INET, found.address.c_str(), &address) != 1)
    return false;
  const std::uint32_t foundAt = ntohl(address.s_addr);
  return listening.address == net::kAnyAddress ? interfaceWith(foundAt) != kAnyInterface
                                               : foundAt == listening.address;
}

}  // namespace hapticd::zeroconf
