#include "server/server.h"

#include <unistd.h>

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>

#include "base/world.h"
#include "realtime/servo/thread_setup.h"

namespace hapticd::server {
namespace {

using namespace std::chrono_literals;
using base::Nanos;

net::ConnectionOptions connectionOptions(const LimitsConfig& limits) {
  net::ConnectionOptions options;
  options.hardLimitBytes = static_cast<std::size_t>(limits.sendQueue_MB) << 20;
  // A client is lost when data stays unacknowledged for this long; silence alone is not loss.
  options.lossTimeout = 500ms;
  options.keepAlive = 1s;
  options.unsentLimitBytes = 32 * 1024;  // some 50 ticks: later ones are skipped, not queued
  return options;
}

std::optional<tls::Context> openTls(const ServerConfig& config) {
  if (config.tls == kTlsOff) return std::nullopt;
  if (config.tls == kTlsGenerated) return tls::Context::serverWithNewKey();
  return tls::Context::server(config.tls, config.tlsKey);
}

}  // namespace

Server::Server(const ServerConfig& config) : Server(config, nullptr) {}

Server::Server(const ServerConfig& config, std::unique_ptr<Player> player)
    : config_((validate(config), config)),
      throttledLog_(static_cast<std::size_t>(config_.limits.log_kB_per_s) * 1000),
      credentials_(config, geteuid()),
      trusted_(parseSubnets(config.trustedNetworks)),
      player_(std::move(player)),
      recordings_(scenes_, stations_,
                  [this](std::function<void()> function) { loop_.post(std::move(function)); },
                  {.folder = std::filesystem::path(config.record).parent_path(),
                   .mostBytes = static_cast<std::uint64_t>(config.limits.recording_MB) * 1'000'000,
                   .onProblem = [this](record::RecorderProblem problem, const std::string& reason) {
                     const bool goesOn = problem == record::RecorderProblem::losses;
                     const wire::Text text{.severity = goesOn ? wire::kTextWarning : wire::kTextError,
                                           .level = 0,
                                           .text = goesOn ? reason : "Recording_Control ended: " + reason};
                     for (const auto& station : stations_) sendText(*station, text);
                   }}) {
  loop_.setErrorHandler([](std::string_view text) { spdlog::error("{}", text); });
  if (auto context = openTls(config)) tls_.emplace(*std::move(context), loop_);
  names_.addSender("VRPN Control");  // must be sender 0, as in stock VRPN
  if (!config_.record.empty()) recordings_.create(config_.record);

  for (const DeviceConfig& device : config_.devices) openDevice(device);

  openPorts();
  openSocket();
  openWeb();
  openHaply();
}

// TCP and UDP have the same number. The system chooses a free one for TCP only.
void Server::openPorts() {
  for (int attempt = 1;; ++attempt) {
    constexpr int kMostAttempts = 20;
    net::Endpoint local = net::Endpoint::parse(config_.listenAddress, config_.port);
    listener_ = std::make_unique<net::TcpListener>(
        loop_, local,
        [this](net::Connection connection) {
          net::Connection safe = secured(std::move(connection));
          if (safe) addSession(std::move(safe), nullptr, SessionMode::tcp);
        },
        connectionOptions(config_.limits));
    local.port = listener_->local().port;
    try {
      reverseConnections_ = std::make_unique<ReverseConnections>(
          loop_, local, connectionOptions(config_.limits), config_.callbackHosts,
          [this](std::uint32_t address) { return config_.insecure || isNear(address); }, throttledLog_,
          [this](net::Connection connection, std::unique_ptr<net::UdpSocket> udp) {
            addSession(std::move(connection), std::move(udp), SessionMode::udp);
          });
      return;
    } catch (const net::Error&) {
      if (config_.port != 0 || attempt == kMostAttempts) throw;
    }
  }
}

Server::~Server() {
  if (player_) player_->stop();
  // Stop the servos first: no force outlives the server.
  for (const auto& station : stations_) station->stop();
  for (const auto& scene : scenes_) scene->stop();
}

// Whether packets of this address travel without TLS.
bool Server::isNear(std::uint32_t address) const {
  if (net::isLoopback(address) && !config_.tlsLoopback) return true;
  return std::any_of(trusted_.begin(), trusted_.end(), [&](const Subnet& s) { return s.has(address); });
}

bool Server::isEncrypted(const Session& session) const {
  return tls_ && session.mode() == SessionMode::tcp && !isNear(session.remote().address);
}

// An empty connection: refused.
net::Connection Server::secured(net::Connection connection) {
  if (isNear(connection.remote().address)) return connection;
  if (tls_) return tls_->wrap(std::move(connection));
  if (config_.insecure) return connection;
  throttledLog_.warnOfLasting("connection from " + connection.remote().addressText() +
                              " refused: its network is not in trusted_networks, and tls is off");
  return {};
}

// For stops when the port is full or flooded, and for clients that the kernel identifies.
void Server::openSocket() {
  if (config_.socket == kSocketOff) return;
  const bool configured = config_.socket != kSocketAuto;
  const std::filesystem::path path =
      configured ? std::filesystem::path(config_.socket) : net::defaultSocketPath(listener_->local());
  try {
    localListener_ = std::make_unique<net::LocalListener>(
        loop_, path,
        [this](net::Connection connection) {
          addSession(std::move(connection), nullptr, SessionMode::local);
        },
        connectionOptions(config_.limits));
  } catch (const net::Error& error) {
    const std::string text =
        std::string(error.what()) + "; choose another path by socket in the configuration";
    if (configured) throw net::Error(text);
    spdlog::warn("no Unix socket: {}", text);
  }
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
                                       connectionOptions(config_.limits), *this, scenes);
  } catch (const net::Error& error) {
    if (configured) throw;
    spdlog::warn("no viewer: {}, or disable it with --http off", error.what());
  }
}

void Server::openHaply() {
  if (config_.compat.haply.empty()) return;
  std::string address = "127.0.0.1";
  std::uint16_t port = kHaplyPort;
  parseListen(config_.compat.haply, address, port);
  haply_ = std::make_unique<HaplyPort>(loop_, net::Endpoint::parse(address, port), config_.compat,
                                       connectionOptions(config_.limits), *this, stations_);
}

void Server::searchNetworkBy(std::unique_ptr<ServerFinder> finder) {
  if (web_) web_->searchNetworkBy(std::move(finder));
}

std::optional<net::Endpoint> Server::haplyAddress() const {
  return haply_ ? std::optional(haply_->local()) : std::nullopt;
}

std::optional<net::Endpoint> Server::webAddress() const {
  return web_ ? std::optional(web_->local()) : std::nullopt;
}

void Server::openDevice(const DeviceConfig& device) {
  std::vector<DeviceName> senders;
  for (const std::string& name : device.names) senders.push_back({names_.addSender(name), View::device});
  if (device.mirrors) {
    for (const std::string& name : device.names) {
      for (const auto& [view, suffix] : kMirrors) senders.push_back({names_.addSender(name + suffix), view});
    }
  }
  SceneHost& scene = sceneFor(device);
  if (player_) {
    const record::RecordedDevice& recorded = player_->header().devices[stations_.size()];
    stations_.push_back(std::make_unique<Station>(device, senders, scene, recorded));
  } else {
    stations_.push_back(std::make_unique<Station>(device, senders, scene, config_.allowNoRealtime));
  }
  for (const auto& station : stations_) {
    if (station != stations_.back() && &station->scene() == &scene)
      stations_.back()->shareControlWith(*station);
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
  return *scenes_.emplace_back(
      std::make_unique<SceneHost>(number, device.scene, device.sceneOnDisconnect, config_.limits));
}

void Server::startPlaying() {
  if (!player_) return;
  player_->start(
      {.tick = [this](std::uint32_t device, const auto& report) { stations_[device]->play(report); },
       .command =
           [this](std::uint32_t scene, scene::ClientId client, const auto* command) {
             if (scene < scenes_.size()) scenes_[scene]->play(client, command);
           },
       .behind =
           [this](std::uint32_t scene) { return scene < scenes_.size() && scenes_[scene]->behindReplay(); },
       .marker =
           [this](Nanos time, const std::string& text) {
             loop_.post([this, time, text] {
               if (!markers_.add(time, text)) throttledLog_.warn("replay: too many markers at one time");
             });
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

void Server::startScene(SceneHost& scene) {
  scene.start(
      {.notices =
           [this, &scene](std::vector<scene::Notice>&& notices) {
             loop_.post([this, &scene, notices = std::move(notices)]() mutable {
               deliver(scene, std::move(notices));
             });
           },
       .relieved = [this](scene::ClientId client) { loop_.post([this, client] { onRelieved(client); }); },
       .applying = [this, number = scene.number()](
                       auto client, Nanos now,
                       const auto* command) { recordings_.command(number, client, now, command); },
       .wasReset =
           [this, &scene] {
             for (const auto& station : stations_) {
               if (&station->scene() == &scene) station->rampIn();
             }
             loop_.post([this, &scene] {
               for (const auto& station : stations_) {
                 if (&station->scene() == &scene) station->onReset();
               }
             });
           }},
      [this](std::function<void()> function) { loop_.post(std::move(function)); });
}

void Server::run() {
  recordings_.begin(clock_.offset(), toToml(config_));
  for (const auto& scene : scenes_) startScene(*scene);
  recordings_.scenesStarted();
  for (const auto& owned : stations_) {
    Station* station = owned.get();
    subscriptions_.push_back(loop_.watchFd(station->wakeFd(), [this, station] {
      net::drainEventFd(station->wakeFd());
      report(*station);
      if (haply_) haply_->answer();
    }));
    station->start();
  }
  subscriptions_.push_back(loop_.every(1s, [this] { everySecond(); }));
  subscriptions_.push_back(loop_.every(50ms, [this] {
    checkClients();
    recordings_.poll();
    if (haply_) haply_->answer();  // a device that is gone has no ticks
    for (const auto& station : stations_) {
      report(*station);  // the rest, should the ticks have ended
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
  if (running_) running_();
  realtime::requestShortTimeSlice();  // reports must not wait for other processes
  loop_.run();
  if (player_) player_->stop();
  for (const auto& [id, session] : sessions_) session->reportLost();
  for (const auto& station : stations_) station->stopForces();  // one that ends slowly delays no other's stop
  for (const auto& station : stations_) station->stop();
  devicesClosed_.store(true, std::memory_order_release);
  for (const auto& scene : scenes_) scene->stop();
  for (const auto& station : stations_) station->finishBlackBox();
  recordings_.finish();
}

void Server::everySecond() {
  if (alive_) alive_();
  clock_.refresh();
  const bool sending = !describedNothing_.empty();
  for (const Session* session : admission_.completedHandshakes(base::now())) {
    if (session->namesWanted() == 0) describedNothing_.push_back(session->id());
  }
  if (!sending) sendPresentStates();
  throttledLog_.reportSuppressed();
  markers_.nextSecond();
  if (web_) web_->everySecond();
}

// A client that describes none of the devices listens to all of them. A few at a time, as with reports.
void Server::sendPresentStates() {
  constexpr int kSlice = 20;
  for (int i = 0; i < kSlice && !describedNothing_.empty(); ++i) {
    const auto session = sessions_.find(describedNothing_.front());
    describedNothing_.pop_front();
    if (session == sessions_.end() || session->second->namesWanted() != 0) continue;
    for (const auto& station : stations_) station->sendPresentState(*session->second);
  }
  if (!describedNothing_.empty()) loop_.post([this] { sendPresentStates(); });
}

void Server::onWebClient(net::Connection connection, std::string_view token, bool ofPage) {
  Session& session = addSession(std::move(connection), nullptr, SessionMode::web);
  if (ofPage) session.setOfPage();
  session.setToken(token);
}

std::optional<HaplyOwner::Refused> Server::refuseHaply(const net::Endpoint& remote) {
  const std::string address = remote.addressText();
  std::optional<Refused> refused;
  if (!isNear(remote.address) && !config_.insecure) {
    refused = {403, "this port is not encrypted, and " + address + " is not in trusted_networks"};
  } else if (!admission_.hasRoom(sourceOf(address))) {
    refused = {503, "the server is full"};
  }
  if (refused)
    throttledLog_.warnOfLasting("haply connection from " + address + " refused: " + refused->reason);
  return refused;
}

Commander Server::admitHaply(const net::Endpoint& remote) {
  const std::string address = remote.addressText();
  admission_.enter(sourceOf(address));
  const scene::ClientId id = nextClient_++;
  throttledLog_.log(spdlog::level::info, address,
                    fmt::format("client {} connected from {}, haply", id, address));
  return {id, address, credentials_.identityOf(remote.address, std::nullopt)};
}

void Server::onHaplyGone(const Commander& client, const std::string& reason) {
  throttledLog_.log(spdlog::level::info, client.address,
                    fmt::format("client {} ({}, haply) disconnected: {}", client.id, client.address, reason));
  for (const auto& station : stations_) station->clientGone(client.id);
  admission_.leave(sourceOf(client.address));
}

void Server::onHaplyWarning(scene::ClientId client, const std::string& text) {
  const std::string source = "client " + std::to_string(client);
  throttledLog_.log(spdlog::level::warn, source, source + ": " + text);
}

ServerStatus Server::status() const {
  ServerStatus status;
  status.run = std::to_string(started_);
  status.uptime_s = base::toSeconds(base::now() - started_);
  status.recording = recordings_.file();
  if (player_) status.replay = player_->status();
  status.scenes.resize(scenes_.size());
  for (const auto& station : stations_) {
    DeviceStatus& device = status.devices.emplace_back(station->status());
    while (scenes_[device.scene].get() != &station->scene()) ++device.scene;
    status.scenes[device.scene].push_back(device.names.front());
  }
  return status;
}

bool Server::addClients(ServerStatus& status) const {
  constexpr int kSlice = 100;
  auto next = status.clients.empty() ? sessions_.begin() : sessions_.upper_bound(status.clients.back().id);
  for (int i = 0; i < kSlice && next != sessions_.end(); ++i, ++next) {
    const Session& session = *next->second;
    ClientStatus& client = status.clients.emplace_back(session.status());
    for (const auto& station : stations_) {
      const bool listens = session.wants(station->nameFor(session));
      if (listens && client.rate_Hz == 0) client.rate_Hz = station->rateOf(session);
      client.commands = client.commands || station->couldCommand(session.commander());
    }
  }
  if (next != sessions_.end()) return true;
  if (haply_) {
    for (ClientStatus& client : haply_->status()) status.clients.push_back(std::move(client));
  }
  return false;
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

bool Server::armed() const noexcept {
  return std::any_of(stations_.begin(), stations_.end(),
                     [](const auto& station) { return station->armed(); });
}

Session& Server::addSession(net::Connection connection, std::unique_ptr<net::UdpSocket> udp,
                            SessionMode mode) {
  const scene::ClientId id = nextClient_++;
  auto session =
      std::make_unique<Session>(id, *this, names_, clock_, std::move(connection), std::move(udp), mode);
  Session& added = *session;
  // One that may fail at TLS is named once it speaks VRPN.
  if (!isEncrypted(added)) {
    throttledLog_.log(spdlog::level::info, added.address(),
                      fmt::format("client {} connected from {}", id, added.description()));
  }
  added.setIdentity(credentials_.identityOf(added.remote().address, added.user()));
  added.setMostPerSecond(config_.limits.commandsPerSecond);
  admission_.enter(added);
  sessions_.emplace(id, std::move(session));
  added.start();
  return added;
}

std::map<scene::ClientId, std::size_t> Server::waitingCommands() const {
  std::map<scene::ClientId, std::size_t> bytes;
  for (const auto& scene : scenes_) {
    for (const auto& [client, waiting] : scene->waiting()) bytes[client] += waiting;
  }
  return bytes;
}

void Server::onEnding(Session& session) {
  for (const auto& station : stations_) station->clientEnds(session.id());
  for (const auto& scene : scenes_) scene->clientGone(session.id());
}

void Server::onClosed(Session& session, const std::string& reason) {
  if (session.greeted() || !isEncrypted(session)) {
    throttledLog_.log(
        spdlog::level::info, session.address(),
        fmt::format("client {} ({}) disconnected: {}", session.id(), session.description(), reason));
  } else {
    // A client without TLS, or that knows another certificate, tries again and again.
    throttledLog_.warnOfLasting("connection from " + session.remote().addressText() + " ended: " + reason);
  }
  std::vector<std::pair<const Station*, wire::Text>> texts;
  for (const auto& station : stations_) {
    if (auto text = station->sessionGone(session)) texts.emplace_back(station.get(), std::move(*text));
  }
  if (!session.ending()) {
    for (const auto& scene : scenes_) scene->clientGone(session.id());
  }
  refusals_.erase(session.id());
  admission_.leave(session);
  sessions_.erase(session.id());
  for (const auto& [station, text] : texts) sendText(*station, text);
}

// Every 50 ms: heartbeats, memory and markers, of a few clients at a time, between which others have their
// turn.
void Server::checkClients() {
  constexpr Nanos kStall = 150'000'000;  // between two checks
  const Nanos now = base::now();
  // This thread has not read what the clients sent.
  if (now - std::exchange(checkedAt_, now) > kStall) {
    for (const auto& [id, session] : sessions_) session->excuseStall(now);
  }
  if (checkedUpTo_) return;
  markers_.beginPass();
  checkNextClients(0);
}

void Server::checkNextClients(scene::ClientId last) {
  constexpr int kSlice = 500;
  const Nanos now = base::now();
  const std::map<scene::ClientId, std::size_t> waiting = waitingCommands();
  auto next = sessions_.upper_bound(last);
  for (int i = 0; i < kSlice && next != sessions_.end(); ++i, ++next) {
    const auto commands = waiting.find(next->first);
    if (markers_.passing()) sendMarkers(*next->second);
    checkHeartbeat(*next->second, now);
    admission_.countMemory(*next->second, commands == waiting.end() ? 0 : commands->second);
  }
  if (next == sessions_.end()) {
    checkedUpTo_.reset();
    admission_.judgeMemory();
    return;
  }
  checkedUpTo_ = std::prev(next)->first;
  loop_.post([this] { checkNextClients(*checkedUpTo_); });
}

// onClosed() destroys the session later.
void Server::checkHeartbeat(Session& session, Nanos now) {
  switch (session.checkHeartbeat(now)) {
    case HeartbeatWatch::Verdict::alive:
      break;
    case HeartbeatWatch::Verdict::lost:
      session.abort("no heartbeat for 500 ms");
      break;
    case HeartbeatWatch::Verdict::excused:
      if (session.ending()) break;
      throttledLog_.log(spdlog::level::warn, session.address(),
                        fmt::format("client {}: no heartbeat came through for 5 s, behind its own data or "
                                    "because the scene is behind; its forces ramp out",
                                    session.id()));
      for (const auto& scene : scenes_) scene->releaseForces(session.id());
      for (const auto& station : stations_) station->endStreams(session.id());
      break;
  }
}

// The client disconnected while the scene is behind. Its last commands are still applied.
void Server::onPeerGone(Session& session, const std::string& reason) {
  throttledLog_.log(spdlog::level::info, session.address(),
                    fmt::format("client {} ({}) disconnected while its commands wait for the scene: {}",
                                session.id(), session.description(), reason));
  for (const auto& station : stations_) station->endStreams(session.id());
  if (session.ending()) return;  // the scenes know
  for (const auto& scene : scenes_) scene->peerGone(session.id());
}

void Server::onHeartbeatAgain(Session& session) {
  for (const auto& scene : scenes_) scene->restoreForces(session.id());
  session.send(
      session.nameOfTexts(),
      wire::Text{.severity = wire::kTextWarning,
                 .level = 0,
                 .text = "Heartbeat: none came through for 5 s, and your forces ramped out; they act again"});
  session.flush();
}

Station* Server::stationOf(wire::LocalSender name) noexcept {
  for (const auto& station : stations_) {
    if (station->has(name)) return station.get();
  }
  return nullptr;
}

void Server::onConnected(Session& session) {
  admission_.greeted(session);
  if (const std::string token = session.takeToken(); !token.empty())
    identify(session, token, wire::LocalSender{0});
  for (const auto& station : stations_) station->onConnected(session);
}

void Server::onCaughtUp(Session& session) {
  for (const auto& station : stations_) station->sendPresentState(session);
}

void Server::onSubscribed(Session& session, wire::LocalSender name) {
  if (Station* station = stationOf(name)) station->onSubscribed(session, name);
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
  if (unfinishedReports_.count(&station) != 0) return station.reportToFirst(clock_, sessions_);
  if (!station.report(clock_, sessions_)) return;
  // The rest after what else waits: a stop does not wait until very many clients got their reports.
  unfinishedReports_.insert(&station);
  loop_.post([this, &station] {
    unfinishedReports_.erase(&station);
    report(station);
  });
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
