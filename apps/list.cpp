// hapticd list: the servers that announce themselves on the network.
#include "server_list.h"

#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>

#include "commands.h"
#include "print_json.h"
#include "zeroconf/find_servers.h"

namespace hapticd::apps {
namespace {

using Servers = std::vector<zeroconf::AnnouncedServer>;

constexpr const char* kNoneFound =
    "no server announces itself: it must listen on the network ('hapticd serve --listen 0.0.0.0:3883'), and\n"
    "both machines need the Avahi daemon (apt install avahi-daemon)";

struct ListOptions {
  double timeout_s = 3;
  bool json = false;
};

nlohmann::json jsonOf(const Servers& servers) {
  nlohmann::json list = nlohmann::json::array();
  for (const zeroconf::AnnouncedServer& server : servers) {
    nlohmann::json devices = nlohmann::json::array();
    for (const std::string& device : server.devices) devices.push_back(server.client(device));
    list.push_back({{"name", server.name},
                    {"address", server.address},
                    {"port", server.port},
                    {"devices", devices},
                    {"page", server.page()},
                    {"tls", server.tls},
                    {"version", server.version}});
  }
  return list;
}

void print(const Servers& servers) {
  for (const zeroconf::AnnouncedServer& server : servers) {
    std::printf("%s, version %s%s\n", server.name.c_str(), server.version.c_str(),
                server.tls ? ", by TLS ('hapticd tunnel')" : "");
    for (const std::string& device : server.devices) std::printf("  %s\n", server.client(device).c_str());
    if (!server.page().empty()) std::printf("  %s\n", server.page().c_str());
  }
}

int run(const ListOptions& options) {
  base::MonotonicClock clock;
  const Servers servers = zeroconf::findServers(clock, base::toNanos(options.timeout_s));
  if (options.json) {
    printJson(jsonOf(servers));
  } else if (!servers.empty()) {
    print(servers);
  } else {
    std::fprintf(stderr, "hapticd: %s\n", kNoneFound);
  }
  return servers.empty() ? 1 : 0;
}

}  // namespace

std::string onlyDeviceOfNetwork() {
  base::MonotonicClock clock;
  const Servers servers = zeroconf::findServers(clock, base::toNanos(ListOptions{}.timeout_s));
  std::vector<std::string> devices;
  bool byTlsOnly = false;
  for (const zeroconf::AnnouncedServer& server : servers) {
    // Several names may belong to one device: the first is its own.
    if (server.devices.empty()) continue;
    devices.push_back(server.client(server.devices.front()));
    byTlsOnly = server.tls;
    if (byTlsOnly) devices.back() += ", by TLS only ('hapticd tunnel')";
  }
  if (devices.empty()) throw std::runtime_error(kNoneFound);
  if (devices.size() == 1 && byTlsOnly)
    throw std::runtime_error("the only device on the network, " + devices.front() +
                             ": start the tunnel, and name its local end by --server");
  if (devices.size() == 1) return devices.front();
  std::string text = "several servers announce themselves; choose one by --server:";
  for (const std::string& device : devices) text += "\n  " + device;
  throw std::runtime_error(text);
}

void addList(CLI::App& app) {
  auto options = std::make_shared<ListOptions>();
  CLI::App* command = app.add_subcommand("list", "List the haptics servers of the network");
  command->add_option("--timeout", options->timeout_s, "Seconds to wait at most")
      ->check(within(0.1, 60))
      ->capture_default_str();
  command->add_flag("--json", options->json, kJsonText);
  command->footer(
      "Servers that listen on the network announce themselves by DNS-SD (Avahi), unless their\n"
      "configuration says 'announce = false'. The exit status is 1 when none is found.\n"
      "'hapticd devices' lists the devices of this machine.\n"
      "Example:\n"
      "  hapticd list --json | jq -r '.[].devices[0]'");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps
