#include "server/server.h"

#include <sys/resource.h>

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <ctime>

#include "base/world.h"
#include "realtime/servo/thread_setup.h"
#include "server/session/refusal_codes.h"
#include "wire/udp_request.h"

namespace hapticd::server {
namespace {

using namespace std::chrono_literals;
using base::Nanos;

constexpr Nanos kHandshakeLimit = 30'000'000'000;
constexpr std::size_t kMostReverseConnections = 64;  // pending at once
constexpr std::size_t kReserve = 16;                 // connections that may only stop forces
constexpr std::uint64_t kOtherDescriptors = 192;     // devices, files, the web port, pending connections

// The program may raise it: see docs/limits.md.
std::size_t mostSessions(std::size_t configured) {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  const std::uint64_t present = limit.rlim_cur;
  // In mode udp a client takes two.
  const std::uint64_t possible = present > 2 * kOtherDescriptors ? (present - kOtherDescriptors) / 2 : 16;
  return std::min<std::size_t>(configured, possible);
}

net::ConnectionOptions connectionOptions() {
  net::ConnectionOptions options;
  // A client is lost when data stays unacknowledged for this long; silence alone is not loss.
  options.lossTimeout = 500ms;
  options.keepAlive = 1s;
  return options;
}

bool isLoopback(std::uint32_t address) {
  return (address >> 24) == 127;
}

// The name may contain strftime conversions, so that every start of the server writes a new file.
std::unique_ptr<record::Recorder> openRecording(const std::string& name) {
  const auto now = static_cast<std::time_t>(base::wallNow() / 1'000'000'000);
  std::tm local{};
  localtime_r(&now, &local);
  char path[4096] = {};
  if (std::strftime(path, sizeof path, name.c_str(), &local) == 0) {
    throw ConfigError("record: '" + name + "' is too long for a file name");
  }
  return std::make_unique<record::Recorder>(path, [](const std::string& text) { spdlog::error("{}", text); });
}

}  // namespace

// A pending TCP connection to a client that requested it by datagram.
struct Server::ReverseConnection {
  net::Endpoint client;
  net::Connection connection;
};

Server::Server(const ServerConfig& config) : Server(config, nullptr) {}

Server::Server(const ServerConfig& config, std::unique_ptr<Player> player)
    : config_(config), player_(std::move(player)) {
  validate(config_);
  loop_.setErrorHandler([](std::string_view text) { spdlog::error("{}", text); });
  names_.addSender("VRPN Control");  // must be sender 0, as in stock VRPN
  if (!config_.record.empty()) recorder_ = openRecording(config_.record);

  for (const DeviceConfig& device : config_.devices) openDevice(device);

  net::Endpoint local = net::Endpoint::parse(config_.listenAddress, config_.port);
  listener_ = std::make_unique<net::TcpListener>(
      loop_, local,
      [this](net::Connection connection) { addSession(std::move(connection), nullptr, SessionMode::tcp); },
      connectionOptions());
  local.port = listener_->local().port;
  requests_ = std::make_unique<net::UdpSocket>(loop_, local);
  requests_->start(
      {.onDatagram = [this](auto bytes, const auto& from) { onUdpRequest(bytes, from); }, .onRefused = {}});
  openWeb();
}

Server::~Server() {
  if (player_) player_->stop();
  // Stop the servos first: no force outlives the server.
  for (const auto& station : stations_) station->stop();
  for (const auto& scene : scenes_) scene->stop();
}

// A clash on the default HTTP port is not an error: run without the viewer.
void Server::openWeb() {
  if (config_.http == kHttpOff) return;
  const bool configured = config_.http != kHttpAuto;
  std::string address = "127.0.0.1";
  std::uint16_t port = 8080;
  if (configured) parseListen(config_.http, address, port);
  std::vector<SceneHost*> scenes;
  for (const auto& scene : scenes_) scenes.push_back(scene.get());
  try {
    web_ = std::make_unique<WebServer>(loop_, net::Endpoint::parse(address, port), config_.httpAllow,
                                       connectionOptions(), *this, scenes);
  } catch (const net::Error& error) {
    if (configured) throw;
    spdlog::warn("no viewer: {}, or disable it with --http off", error.what());
  }
}

std::optional<net::Endpoint> Server::webAddress() const {
  return web_ ? std::optional(web_->local()) : std::nullopt;
}

void Server::openDevice(const DeviceConfig& device) {
  std::vector<wire::LocalSender> senders;
  for (const std::string& name : device.names) senders.push_back(names_.addSender(name));
  SceneHost& scene = sceneFor(device);
  if (player_) {
    const record::RecordedDevice& recorded = player_->header().devices[stations_.size()];
    stations_.push_back(std::make_unique<Station>(device, senders, scene, recorded));
  } else {
    stations_.push_back(
        std::make_unique<Station>(device, senders, scene, config_.allowNoRealtime, recorder_.get()));
  }
}

// Devices that name the same scene share it.
SceneHost& Server::sceneFor(const DeviceConfig& device) {
  if (!device.scene.empty()) {
    for (const auto& scene : scenes_) {
      if (scene->name() == device.scene) return *scene;
    }
  }
  const auto number = static_cast<std::uint32_t>(scenes_.size());
  return *scenes_.emplace_back(std::make_unique<SceneHost>(number, device.scene, device.sceneOnDisconnect));
}

void Server::startPlaying() {
  if (!player_) return;
  player_->start(
      {.tick = [this](std::uint32_t device, const auto& report) { stations_[device]->play(report); },
       .command =
           [this](std::uint32_t scene, scene::ClientId client, const auto* command) {
             if (scene < scenes_.size()) scenes_[scene]->play(client, command);
           },
       .restart =
           [this] {
             const scene::SceneCommand reset = scene::ResetScene{};
             for (const auto& scene : scenes_) scene->play(0, &reset);
           },
       .ended =
           [](const std::string& remark) {
             if (!remark.empty()) spdlog::warn("replay: {}", remark);
             spdlog::info("replay finished; the last state stays");
           }});
}

void Server::startRecording() {
  if (!recorder_) return;
  recorder_->start(clock_.offset(), toToml(config_));
  spdlog::info("recording to {}", recorder_->path().string());
}

void Server::finishRecording() {
  if (!recorder_) return;
  recorder_->finish();
  const record::RecorderCounts& counts = recorder_->counts();
  spdlog::info("recorded {} ticks, {:.1f} MB, in {}{}", counts.ticks,
               static_cast<double>(counts.bytes) * 1e-6, recorder_->path().string(),
               recorder_->writes() ? "" : ", which is incomplete");
  recorder_.reset();
}

void Server::startScene(SceneHost& scene) {
  std::function<void(scene::ClientId, Nanos, const scene::SceneCommand*)> applying;
  if (recorder_) {
    applying = [this, number = scene.number()](auto client, Nanos now, const auto* command) {
      recorder_->recordCommand(number, client, now, command);
    };
  }
  scene.start(
      {.notices =
           [this, &scene](std::vector<scene::Notice>&& notices) {
             loop_.post([this, &scene, notices = std::move(notices)]() mutable {
               deliver(scene, std::move(notices));
             });
           },
       .relieved = [this](scene::ClientId client) { loop_.post([this, client] { onRelieved(client); }); },
       .applying = std::move(applying)},
      [this](std::function<void()> function) { loop_.post(std::move(function)); });
}

void Server::run() {
  startRecording();
  for (const auto& scene : scenes_) startScene(*scene);
  for (const auto& owned : stations_) {
    Station* station = owned.get();
    subscriptions_.push_back(loop_.watchFd(station->wakeFd(), [this, station] {
      net::drainEventFd(station->wakeFd());
      report(*station);
    }));
    station->start();
  }
  subscriptions_.push_back(loop_.every(1s, [this] { everySecond(); }));
  subscriptions_.push_back(loop_.every(50ms, [this] {
    checkHeartbeats();
    for (const auto& station : stations_) {
      station->checkBlackBox();
      if (const auto text = station->checkHealth()) sendText(*station, *text);
    }
  }));
  if (config_.seconds > 0) {
    subscriptions_.push_back(loop_.after(
        std::chrono::duration_cast<net::Loop::Duration>(std::chrono::duration<double>(config_.seconds)),
        [this] { loop_.stop(); }));
  }
  startPlaying();
  realtime::requestShortTimeSlice();  // reports must not wait for other processes
  loop_.run();
  if (player_) player_->stop();
  for (const auto& station : stations_) station->stop();
  devicesClosed_.store(true, std::memory_order_release);
  for (const auto& scene : scenes_) scene->stop();
  finishRecording();
}

void Server::everySecond() {
  clock_.refresh();
  closeStaleHandshakes();
  throttledLog_.reportSuppressed();
  if (web_) web_->everySecond();
}

void Server::onWebClient(net::Connection connection) {
  addSession(std::move(connection), nullptr, SessionMode::web);
}

ServerStatus Server::status() const {
  ServerStatus status;
  status.uptime_s = base::toSeconds(base::now() - started_);
  if (recorder_ && recorder_->writes()) status.recording = recorder_->path().string();
  status.scenes.resize(scenes_.size());
  for (const auto& station : stations_) {
    DeviceStatus& device = status.devices.emplace_back(station->status());
    while (scenes_[device.scene].get() != &station->scene()) ++device.scene;
    status.scenes[device.scene].push_back(device.names.front());
  }
  for (const auto& [id, session] : sessions_) {
    ClientStatus& client = status.clients.emplace_back(session->status());
    for (const auto& station : stations_) {
      const bool listens = session->wants(station->nameFor(*session));
      if (listens && client.rate_Hz == 0) client.rate_Hz = station->rateOf(*session);
      client.commands = client.commands || station->couldCommand(*session);
    }
  }
  return status;
}

// Sends a text to all clients of this device.
void Server::sendText(const Station& station, const wire::Text& text) {
  for (const auto& [id, session] : sessions_) {
    const wire::LocalSender name = station.nameFor(*session);
    if (!session->wants(name)) continue;
    session->send(name, text);
    session->flush();
  }
}

void Server::stop() {
  loop_.stop();
}

bool Server::stopForces() noexcept {
  constexpr Nanos kLongest = 40'000'000;
  for (const auto& station : stations_) station->stopForces();
  const auto atZero = [](const auto& station) { return station->isStoppedAtZero(); };
  for (const Nanos end = base::now() + kLongest; base::now() < end; base::sleepFor(500'000)) {
    if (std::all_of(stations_.begin(), stations_.end(), atZero)) return true;
  }
  return false;
}

void Server::addSession(net::Connection connection, std::unique_ptr<net::UdpSocket> udp, SessionMode mode) {
  const scene::ClientId id = nextClient_++;
  auto session =
      std::make_unique<Session>(id, *this, names_, clock_, std::move(connection), std::move(udp), mode);
  throttledLog_.log(spdlog::level::info, session->address(),
                    fmt::format("client {} connected from {}", id, session->description()));
  Session& added = *session;
  sessions_.emplace(id, std::move(session));
  handshakes_.emplace(id, base::now());
  admit(added);
  added.start();
}

// Beyond the limits a client may still stop forces. The newest have this chance: those that hold on to theirs
// must not keep others from it.
void Server::admit(Session& session) {
  const std::string address = session.address();
  const std::size_t ofAddress = ++sessionsOf_[address];
  const bool full =
      sessions_.size() - reserve_.size() > mostSessions(static_cast<std::size_t>(config_.connections));
  if (!full && ofAddress <= static_cast<std::size_t>(config_.connectionsPerAddress)) return;
  reserve_.push_back(session.id());
  if (reserve_.size() <= kReserve) return;
  const auto oldest = sessions_.find(reserve_.front());
  if (oldest != sessions_.end()) oldest->second->close("the server is full, and others wait to stop forces");
}

bool Server::mayOnlyStop(const Session& session) const noexcept {
  return std::find(reserve_.begin(), reserve_.end(), session.id()) != reserve_.end();
}

void Server::onUdpRequest(std::span<const std::byte> datagram, const net::Endpoint& from) {
  const auto request = wire::parseUdpRequest(datagram);
  if (!request) {
    throttledLog_.warn("datagram from " + from.text() + " is not a connection request: " + request.error());
    return;
  }
  net::Endpoint client;
  try {
    client = net::Endpoint::parse(request->host, request->port);
  } catch (const net::Error& error) {
    throttledLog_.warn("connection request from " + from.text() + " refused: " + error.what());
    return;
  }
  // A forged request must not make this server connect to third parties.
  const bool sameHost =
      client.address == from.address || (isLoopback(client.address) && isLoopback(from.address));
  const auto& allowed = config_.callbackHosts;
  if (!sameHost && std::find(allowed.begin(), allowed.end(), request->host) == allowed.end()) {
    throttledLog_.warn("connection request from " + from.text() + " names another host, " + client.text() +
                       ": refused; allow it with callback_hosts");
    return;
  }
  connectToClient(client);
}

void Server::connectToClient(const net::Endpoint& client) {
  // Clients repeat their request until the server connects.
  for (const auto& pending : reverseConnections_) {
    if (pending->client == client) return;
  }
  if (reverseConnections_.size() >= kMostReverseConnections) {
    throttledLog_.warn("connection request to " + client.text() +
                       " ignored: " + std::to_string(kMostReverseConnections) + " others are pending");
    return;
  }
  auto owned = std::make_unique<ReverseConnection>();
  ReverseConnection* pending = owned.get();
  pending->client = client;
  pending->connection = net::Connection::connect(loop_, client, 2s, connectionOptions());
  const auto forget = [this, pending] {
    std::erase_if(reverseConnections_, [pending](const auto& entry) { return entry.get() == pending; });
  };
  pending->connection.start(
      {.onConnected =
           [this, pending, forget] {
             net::Endpoint local = pending->connection.local();
             local.port = 0;
             auto udp = std::make_unique<net::UdpSocket>(loop_, local);
             net::Connection connection = std::move(pending->connection);
             forget();
             // All of 127.0.0.0/8 is this machine; any other address of its own is its source address, too.
             const net::Endpoint remote = connection.remote();
             if (remote.port == address().port &&
                 (isLoopback(remote.address) || remote.address == connection.local().address)) {
               throttledLog_.warn("connection request names this server itself: refused");
               return;
             }
             addSession(std::move(connection), std::move(udp), SessionMode::udp);
           },
       .onBytes = {},
       .onDrained = {},
       .onClosed =
           [this, client, forget](const std::string& reason) {
             throttledLog_.warn("reverse connection to " + client.text() + " failed: " + reason);
             forget();
           }});
  reverseConnections_.push_back(std::move(owned));
}

void Server::onClosed(Session& session, const std::string& reason) {
  throttledLog_.log(
      spdlog::level::info, session.address(),
      fmt::format("client {} ({}) disconnected: {}", session.id(), session.description(), reason));
  for (const auto& station : stations_) station->clientGone(session.id());
  for (const auto& scene : scenes_) scene->clientGone(session.id());
  handshakes_.erase(session.id());
  std::erase(reserve_, session.id());
  const auto ofAddress = sessionsOf_.find(session.address());
  if (ofAddress != sessionsOf_.end() && --ofAddress->second == 0) sessionsOf_.erase(ofAddress);
  sessions_.erase(session.id());
}

void Server::closeStaleHandshakes() {
  const Nanos now = base::now();
  for (auto entry = handshakes_.begin(); entry != handshakes_.end();) {
    const auto session = sessions_.find(entry->first);
    if (session == sessions_.end() || session->second->connected()) {
      entry = handshakes_.erase(entry);
      continue;
    }
    if (now - entry->second > kHandshakeLimit) session->second->close("no VRPN greeting within 30 s");
    ++entry;
  }
}

// Disconnect clients whose heartbeat expired. onClosed() destroys the session later.
void Server::checkHeartbeats() {
  constexpr Nanos kStall = 150'000'000;  // between two checks; 50 ms are usual
  const Nanos now = base::now();
  const bool stalled = now - std::exchange(heartbeatsCheckedAt_, now) > kStall;
  if (stalled) {  // this thread has not read what the clients sent
    for (const auto& [id, session] : sessions_) session->excuseStall(now);
    return;
  }
  for (const auto& [id, session] : sessions_) {
    switch (session->checkHeartbeat(now)) {
      case HeartbeatWatch::Verdict::alive:
        break;
      case HeartbeatWatch::Verdict::lost:
        session->abort("no heartbeat for 500 ms");
        break;
      case HeartbeatWatch::Verdict::excused:
        spdlog::warn("client {}: read no heartbeat for 5 s because the scene is behind; its forces ramp out",
                     id);
        releaseForces(id);
        break;
    }
  }
}

// The client disconnected while the scene is behind. Its last commands are still applied.
void Server::onPeerGone(Session& session, const std::string& reason) {
  throttledLog_.log(spdlog::level::info, session.address(),
                    fmt::format("client {} ({}) disconnected while its commands wait for the scene: {}",
                                session.id(), session.description(), reason));
  releaseForces(session.id());
}

void Server::releaseForces(scene::ClientId client) {
  for (const auto& scene : scenes_) scene->releaseForces(client);
}

Station* Server::stationOf(wire::LocalSender name) noexcept {
  for (const auto& station : stations_) {
    if (station->has(name)) return station.get();
  }
  return nullptr;
}

void Server::onSubscribed(Session& session, wire::LocalSender name) {
  if (Station* station = stationOf(name)) station->onSubscribed(session, name);
}

// Dispatch by role: control messages never wait for the scene.
void Server::onMessage(Session& session, const wire::MessageReceived& message, Nanos received) {
  Station* station = stationOf(message.local_sender);
  if (station == nullptr || !mayCommand(session, *station, message)) return;
  switch (wire::role(message.kind)) {
    case wire::Role::control:
      station->onControl(session, message, received);
      return;
    case wire::Role::scene:
      onSceneMessage(session, *station, message);
      return;
    case wire::Role::report:  // no effect, but a malformed one is refused like every other message
      if (const auto decoded = wire::decode(message.kind, message.payload); !decoded)
        session.refuse("malformed message: " + decoded.error());
      return;
    case wire::Role::unknown:
      return;
  }
}

void Server::onSceneMessage(Session& session, Station& station, const wire::MessageReceived& message) {
  std::string error;
  if (!station.scene().take(session.id(), message, error)) {
    session.refuse("malformed message: " + error);
    return;
  }
  if (message.kind != wire::kindOf<wire::ResetScene>) return;
  for (const auto& other : stations_) {
    if (&other->scene() == &station.scene()) other->onReset();
  }
}

bool Server::mayCommand(Session& session, Station& station, const wire::MessageReceived& message) {
  std::string reason;
  if (message.kind == wire::kindOf<wire::StopForces>) return true;
  if (!reserve_.empty() && mayOnlyStop(session)) {
    if (message.kind == wire::kindOf<wire::Ping> || message.kind == wire::kindOf<wire::Heartbeat>)
      return true;
    reason = "the server is full: this connection may only stop forces";
  } else if (!wire::needsControl(message.kind) || station.mayCommand(session, reason)) {
    return true;
  }
  // Send one text for each read: a refused upload has thousands of messages.
  if (std::exchange(refusalSentTo_, session.id()) != session.id()) {
    session.send(message.local_sender,
                 wire::Text{.severity = wire::kTextError,
                            .level = static_cast<std::uint32_t>(RefusalCode::notPermitted),
                            .text = std::string(wire::info(message.kind).name) + " refused: " + reason});
  }
  return false;
}

void Server::onWarning(const Session& session, const std::string& text) {
  const std::string client = "client " + std::to_string(session.id());
  throttledLog_.log(spdlog::level::warn, client, client + ": " + text);
}

void Server::onNote(const Session& session, const std::string& text) {
  throttledLog_.log(spdlog::level::info, session.address(),
                    fmt::format("client {} ({}) {}", session.id(), session.description(), text));
}

// A client that sends much data must not delay the reports to others.
void Server::onReadSlice() {
  for (const auto& station : stations_) report(*station);
}

void Server::onReadEnd(Session& session) {
  refusalSentTo_ = 0;
  for (const auto& scene : scenes_) {
    scene->flush(session.id());
    if (scene->full(session.id())) session.hold();
  }
}

// The scene caught up with the client.
void Server::onRelieved(scene::ClientId client) {
  const auto session = sessions_.find(client);
  if (session == sessions_.end()) return;
  const auto full = [&](const auto& scene) { return scene->full(client); };
  if (std::any_of(scenes_.begin(), scenes_.end(), full)) return;
  if (session->second->release()) loop_.post([this, client] { onRelieved(client); });
}

void Server::report(Station& station) {
  const bool any = station.collectReports(clock_, [this, &station] {
    for (const auto& [id, session] : sessions_) station.sendReports(*session);
  });
  if (!any) return;
  for (const auto& [id, session] : sessions_) session->flush();
}

wire::LocalSender Server::nameFor(const Session& session, const SceneHost& scene) const noexcept {
  const Station* first = nullptr;
  for (const auto& station : stations_) {
    if (&station->scene() != &scene) continue;
    if (session.wants(station->nameFor(session))) return station->nameFor(session);
    if (first == nullptr) first = station.get();
  }
  return first->nameFor(session);
}

void Server::deliver(const SceneHost& scene, std::vector<scene::Notice>&& notices) {
  for (const scene::Notice& notice : notices) {
    const auto session = sessions_.find(notice.client);
    if (session == sessions_.end()) continue;
    session->second->send(
        nameFor(*session->second, scene),
        wire::Text{.severity = static_cast<std::uint32_t>(notice.severity), .level = 0, .text = notice.text});
    session->second->flush();
  }
}

}  // namespace hapticd::server
