#include "server/compat/haply_port.h"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <span>

#include "server/compat/haply_messages.h"
#include "wire/text.h"

namespace hapticd::server {
namespace {

constexpr std::size_t kAnswersAtOnce = 8;  // to one client, each tick

net::HttpOptions httpOptions(const net::ConnectionOptions& connection) {
  net::HttpOptions options;
  options.connection = connection;
  return options;
}

std::string shortened(std::string_view text) {
  constexpr std::size_t kShown = 80;
  return wire::inQuotes(std::string(text.substr(0, kShown)));
}

}  // namespace

struct HaplyPort::Client {
  Commander who;
  net::Connection connection;
  std::deque<bool> unanswered;  ///< messages in order: whether the answer is a full frame
  bool paused = false;
  std::set<const Station*> pushes;  ///< devices on which its last force was not zero
  std::set<std::string> ignored;    ///< commands that it was warned about
  base::Nanos since = base::now();
};

HaplyPort::HaplyPort(net::Loop& loop, const net::Endpoint& local, const CompatConfig& config,
                     const net::ConnectionOptions& connection, HaplyOwner& owner,
                     const std::vector<std::unique_ptr<Station>>& stations)
    : config_(config),
      owner_(owner),
      stations_(stations),
      http_(
          loop, local, [this](const auto& request, const auto& reply) { onRequest(request, reply); },
          httpOptions(connection), "haply"),
      access_(http_.local(), {}) {}

HaplyPort::~HaplyPort() = default;

// This port has no page of its own, so an Origin is always that of another site.
std::string HaplyPort::refusal(const net::HttpRequest& request) const {
  net::HttpRequest withoutOrigin = request;
  std::erase_if(withoutOrigin.headers, [](const auto& header) { return header.first == "origin"; });
  const std::string refusal = access_.refusal(withoutOrigin);
  if (!refusal.empty()) return refusal;
  for (const auto& [name, value] : request.headers) {
    if (name != "origin") continue;
    const auto& allowed = config_.haplyOrigins;
    if (std::find(allowed.begin(), allowed.end(), value) != allowed.end()) continue;
    return "pages from " + shortened(value) + " may not use this port: allow the origin with haply_origins";
  }
  return "";
}

void HaplyPort::onRequest(const net::HttpRequest& request, const net::HttpReply& reply) {
  const std::string refused = refusal(request);
  if (!refused.empty()) {
    reply(net::HttpResponse::of(403, refused + '\n'));
  } else if (clients_.size() >= kMostClients) {
    reply(net::HttpResponse::of(503, fmt::format("{} clients are connected, the most\n", kMostClients)));
  } else if (const auto notAdmitted = owner_.refuseHaply(request.remote)) {
    reply(net::HttpResponse::of(notAdmitted->status, notAdmitted->reason + '\n'));
  } else {
    net::HttpResponse response = net::HttpResponse::of(426, "this port is a WebSocket of JSON messages\n");
    response.headers = {{"Upgrade", "websocket"}, {"Connection", "Upgrade"}};
    response.onWebSocket = [this](net::Connection connection) { add(std::move(connection)); };
    response.webSocketOfTexts = true;
    reply(std::move(response));
  }
}

void HaplyPort::add(net::Connection connection) {
  auto client = std::make_unique<Client>();
  client->who = owner_.admitHaply(connection.remote());
  client->connection = std::move(connection);
  Client& added = *client;
  clients_.emplace(added.who.id, std::move(client));
  added.connection.start(
      {.onConnected = {},
       .onBytes =
           [this, &added](std::span<const std::byte> bytes) {
             onMessage(added, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
           },
       .onDrained = {},
       .onPeerGone = [&added](const std::string& reason) { added.connection.abort(reason); },
       .onClosed = [this, id = added.who.id](const std::string& reason) { gone(id, reason); }});
  const std::string first = frame(added, true);
  added.connection.send(std::as_bytes(std::span(first)));
  added.connection.flush();
}

void HaplyPort::onMessage(Client& client, std::string_view text) {
  try {
    client.unanswered.push_back(obey(client, text));
  } catch (const haply::MessageError& error) {
    client.connection.close("no message of this protocol: " + wire::inQuotes(error.what()));
    return;
  }
  if (client.unanswered.size() < kMostUnanswered || client.paused) return;
  client.paused = true;
  client.connection.pauseReading();
}

// Returns whether the client wants a full frame.
bool HaplyPort::obey(Client& client, std::string_view text) {
  const haply::Commands commands = haply::parseCommands(text);
  for (const haply::WantedForce& wanted : commands.forces) {
    const auto station = std::find_if(stations_.begin(), stations_.end(),
                                      [&](const auto& known) { return known->name() == wanted.device; });
    if (station != stations_.end()) {
      force(client, **station, wanted.force_N);
    } else {
      owner_.onHaplyWarning(client.who.id, "there is no device " + shortened(wanted.device));
    }
  }
  for (const std::string& name : commands.ignored) {
    constexpr std::size_t kMostNames = 64;
    if (client.ignored.size() < kMostNames && client.ignored.insert(name).second)
      owner_.onHaplyWarning(client.who.id, shortened(name) + " is not supported and has no effect");
  }
  return commands.wantsConfig;
}

// A client that only wants states sends zero forces: it must not keep another from the device.
void HaplyPort::force(Client& client, Station& station, const geometry::Vec3& force_N) {
  const bool pushes = !force_N.isZero(0);
  if (!pushes && client.pushes.erase(&station) == 0) return;
  std::string reason;
  if (!station.mayCommand(client.who, wire::kindOf<wire::HeldForce>, reason)) {
    owner_.onHaplyWarning(client.who.id, "force on '" + station.name() + "' refused: " + reason);
    return;
  }
  if (pushes) client.pushes.insert(&station);
  const Refusal refusal =
      station.holdForce(client.who.id, force_N, base::toNanos(config_.haplyHold_s), base::now());
  if (!refusal.text.empty())
    owner_.onHaplyWarning(client.who.id, "'" + station.name() + "': " + refusal.text);
}

std::string HaplyPort::frame(const Client& client, bool config) const {
  std::vector<haply::ShownDevice> shown;
  for (const auto& station : stations_) {
    const realtime::TickReport& last = station->lastTick();
    const realtime::GuardReport& guard = last.guard;
    shown.push_back({station->name(), last.device, last.force_N, !last.remote.heldForce_N.isZero(0),
                     guard.stopped || !guard.armed || guard.latched != 0});
  }
  return haply::stateFrame(client.who.id, shown, config);
}

void HaplyPort::answer() {
  for (const auto& [id, client] : clients_) {
    std::deque<bool>& unanswered = client->unanswered;
    if (unanswered.empty()) continue;
    std::string same;
    for (std::size_t i = 0; i < kAnswersAtOnce && !unanswered.empty(); ++i) {
      const bool config = unanswered.front();
      unanswered.pop_front();
      if (!config && same.empty()) same = frame(*client, false);
      const std::string text = config ? frame(*client, true) : same;
      client->connection.send(std::as_bytes(std::span(text)));
    }
    client->connection.flush();
    if (!client->paused || unanswered.size() > kMostUnanswered / 2) continue;
    client->paused = false;
    client->connection.resumeReading();
  }
}

std::vector<ClientStatus> HaplyPort::status() const {
  std::vector<ClientStatus> all;
  for (const auto& [id, client] : clients_) {
    const net::ConnectionStatistics traffic = client->connection.statistics();
    ClientStatus& status = all.emplace_back();
    status.id = id;
    status.address = client->connection.remote().text();
    status.mode = "haply";
    status.role = nameOf(client->who.identity.role);
    for (const auto& station : stations_) {
      status.devices.push_back(station->name());
      status.commands = status.commands || station->couldCommand(client->who);
    }
    status.connected_s = base::toSeconds(base::now() - client->since);
    status.bytesIn = traffic.bytesIn;
    status.bytesOut = traffic.bytesOut;
    status.dropped = traffic.droppedBuffers;
    status.queuedBytes = traffic.queuedBytes;
    status.unacknowledgedBytes = traffic.unacknowledgedBytes;
  }
  return all;
}

void HaplyPort::gone(scene::ClientId id, const std::string& reason) {
  const auto client = clients_.find(id);
  if (client == clients_.end()) return;
  const Commander who = client->second->who;
  clients_.erase(client);
  owner_.onHaplyGone(who, reason);
}

}  // namespace hapticd::server
