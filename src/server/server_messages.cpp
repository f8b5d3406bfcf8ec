// What the server does with messages of its clients: those of a device go to its station, those of a scene to
// the scene; what concerns the whole server is handled here.
#include <spdlog/spdlog.h>

#include <cmath>

#include "server/server.h"
#include "server/session/refusal_codes.h"
#include "wire/text.h"

namespace hapticd::server {

using base::Nanos;

constexpr Nanos kRefusalPeriod = 1'000'000'000;
// A program that sends one batch after the other learns of each what became of it.
constexpr int kRefusedCommits = 20;

namespace {

// As in the texts of the rooms: extensions without the prefix that they have on the wire.
std::string nameInTexts(wire::MessageKind kind) {
  constexpr std::string_view kPrefix = "hapticd ";
  std::string_view name = wire::info(kind).name;
  if (name.starts_with(kPrefix)) name.remove_prefix(kPrefix.size());
  return std::string(name);
}

}  // namespace

// Dispatch by role: control messages never wait for the scene.
void Server::onMessage(Session& session, const wire::MessageReceived& message, Nanos received) {
  Station* station = stationOf(message.local_sender);
  // Of any sender: it concerns the connection.
  if (message.kind == wire::kindOf<wire::Identify>) return onIdentify(session, message);
  if (station == nullptr) return;
  // They act for a moment after their receipt, however late the server reads them.
  if ((session.peerGone() || session.forcesEnded()) &&
      (message.kind == wire::kindOf<wire::RemoteContacts> || message.kind == wire::kindOf<wire::HeldForce>))
    return;
  if (!mayCommand(session, *station, message)) return;
  switch (wire::role(message.kind)) {
    case wire::Role::control:
      if (message.kind == wire::kindOf<wire::Marker>) return onMarker(session, message, received);
      if (message.kind == wire::kindOf<wire::ReplayControl>) return onReplayControl(session, message);
      if (message.kind == wire::kindOf<wire::RecordingControl>) return onRecordingControl(session, message);
      station->onControl(session, message, received, credentials_.hasOperators(), localListener_ != nullptr);
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

void Server::onIdentify(Session& session, const wire::MessageReceived& message) {
  const auto decoded = wire::decode<wire::Identify>(message.payload);
  if (!decoded) {
    session.refuse("malformed message: " + decoded.error());
    return;
  }
  if (decoded->key != 0) {
    session.setKey(decoded->key);
    for (const auto& station : stations_) station->setKey(session.id(), decoded->key);
  }
  const std::string_view token = decoded->token.view();
  if (!token.empty()) identify(session, token, message.local_sender);
}

void Server::identify(Session& session, std::string_view token, wire::LocalSender name) {
  std::string error;
  const auto identity = credentials_.check(token, session.source(), base::now(), error);
  if (!identity) {
    session.logWarning("(" + session.description() + ") presented a token that is refused: " + error);
    session.send(name, wire::Text{.severity = wire::kTextError,
                                  .level = static_cast<std::uint32_t>(RefusalCode::tokenRefused),
                                  .text = "Identify refused: " + error});
    return;
  }
  session.setIdentity(*identity);
  onNote(session, "is " + std::string(nameOf(identity->role)) + " by a token");
}

void Server::onMarker(Session& session, const wire::MessageReceived& message, Nanos received) {
  const auto marker = wire::decode<wire::Marker>(message.payload);
  if (!marker) return session.refuse("malformed message: " + marker.error());
  const Markers::Answer answer = markers_.count(session.id());
  if (answer != Markers::Answer::taken || !markers_.add(received, marker->text.text)) {
    const bool ofClient = answer == Markers::Answer::tooManyOfClient;
    session.send(
        message.local_sender,
        wire::Text{.severity = wire::kTextError,
                   .level = 0,
                   .text = "Marker refused: the server takes " +
                           std::to_string(ofClient ? Markers::kMostOfOne : Markers::kMost) +
                           " in a second from " + (ofClient ? "each client" : "all clients together")});
    return;
  }
  if (recordings_.file().empty()) {
    session.send(message.local_sender,
                 wire::Text{.severity = wire::kTextNormal,
                            .level = 0,
                            .text = "marked for all clients; this server records nothing"});
  }
  recordings_.marker(received, marker->text.text);
  throttledLog_.log(spdlog::level::info, session.address(),
                    fmt::format("client {} marks {}", session.id(), wire::inQuotes(marker->text.text)));
}

// Those of the pass at hand, once, under a name that the client knows.
void Server::sendMarkers(Session& session) {
  for (const auto& station : stations_) {
    const wire::LocalSender name = station->nameFor(session);
    if (!session.wants(name)) continue;
    session.sendShared(markers_.frames(name, clock_.now()), net::Delivery::reliable);
    session.flush();
    return;
  }
}

void Server::onReplayControl(Session& session, const wire::MessageReceived& message) {
  const auto wanted = wire::decode<wire::ReplayControl>(message.payload);
  if (!wanted) return session.refuse("malformed message: " + wanted.error());
  if (!player_) {
    session.send(message.local_sender,
                 wire::Text{.severity = wire::kTextError,
                            .level = 0,
                            .text = "Replay_Control refused: this server replays no recording; start one by "
                                    "'hapticd replay FILE'"});
    return;
  }
  if (!std::isfinite(wanted->speed) || wanted->speed < 0 || std::isnan(wanted->position)) {
    session.send(
        message.local_sender,
        wire::Text{.severity = wire::kTextError,
                   .level = 0,
                   .text = fmt::format("Replay_Control refused: speed {}, position {} s: use a speed of 0 "
                                       "to keep it or a positive one, and a negative position to stay",
                                       wanted->speed, wanted->position)});
    return;
  }
  ReplayOrder order{.paused = wanted->paused != 0, .speed = wanted->speed, .position_s = {}};
  if (wanted->position >= 0) order.position_s = wanted->position;
  player_->order(order);
}

// Both outcomes are a text: the client that asked for a recording wants to know the file.
void Server::onRecordingControl(Session& session, const wire::MessageReceived& message) {
  const auto wanted = wire::decode<wire::RecordingControl>(message.payload);
  if (!wanted) return session.refuse("malformed message: " + wanted.error());
  const auto answer = [this, id = session.id(), name = message.local_sender](std::uint32_t severity,
                                                                             const std::string& text) {
    const auto client = sessions_.find(id);
    if (client == sessions_.end()) return;
    client->second->send(name, wire::Text{.severity = severity, .level = 0, .text = text});
    client->second->flush();
  };
  const auto refuse = [&](const std::string& why) { answer(wire::kTextError, "Recording_Control " + why); };
  if (player_) return refuse("refused: this server replays a recording");
  const std::string name(wanted->name.view());
  Recordings::Listener listener{session.id(),
                                [answer](const std::string& text) { answer(wire::kTextNormal, text); }};
  try {
    if (wanted->record == 0) return recordings_.end(name, std::move(listener));
    recordings_.start(
        name, clock_.offset(), toToml(config_),
        [answer, id = session.id()](const std::string& refusal, const std::string& file) {
          if (!refusal.empty()) return answer(wire::kTextError, "Recording_Control " + refusal);
          spdlog::info("client {} began it", id);
          answer(wire::kTextNormal, "recording to " + file);
        },
        std::move(listener));
  } catch (const record::RecordingError& error) {
    refuse(error.what());
  }
}

void Server::onSceneMessage(Session& session, Station& station, const wire::MessageReceived& message) {
  std::string error;
  if (!station.scene().take(session.id(), message, error)) session.refuse("malformed message: " + error);
}

bool Server::isPermitted(Session& session, Station& station, const wire::MessageReceived& message,
                         std::string& reason) {
  const wire::MessageKind kind = message.kind;
  if (kind == wire::kindOf<wire::StopForces> || station.letsGo(session.id(), message)) return true;
  if (!admission_.mayOnlyStop(session))
    return !wire::needsControl(kind) || station.mayCommand(session.commander(), kind, reason);
  // A client library asks first whether the server knows a stop, and 'hapticd stop' whether it was carried
  // out.
  for (const wire::MessageKind free :
       {wire::kindOf<wire::Ping>, wire::kindOf<wire::Heartbeat>, wire::kindOf<wire::QueryCapabilities>,
        wire::kindOf<wire::RearmForces>, wire::kindOf<wire::TrackerRequestToRoom>})
    if (kind == free) return true;
  reason = "the server is full: this connection may only stop and re-arm forces";
  return false;
}

// A batch is whole: what its client may do when it begins holds until its commit.
bool Server::mayCommand(Session& session, Station& station, const wire::MessageReceived& message) {
  SceneHost& scene = station.scene();
  std::string reason;
  const std::optional<bool> batch =
      wire::role(message.kind) == wire::Role::scene ? scene.batchOf(session.id()) : std::nullopt;
  const bool permitted = batch ? *batch : isPermitted(session, station, message, reason);
  const bool ofRefusedBatch = batch && !permitted;
  if (ofRefusedBatch) reason = scene.refusalOfBatch(session.id());
  if (message.kind == wire::kindOf<wire::BatchBegin>)
    scene.beginBatch(session.id(), permitted ? std::nullopt : std::optional(reason));
  if (message.kind == wire::kindOf<wire::BatchCommit>) scene.endBatch(session.id());
  if (permitted) return true;
  // A refused upload has thousands of messages, a stream a thousand in each second.
  Refusal& refusal = refusals_[session.id()][{message.local_sender, message.kind}];
  const Nanos now = base::now();
  const int most = message.kind == wire::kindOf<wire::BatchCommit> ? kRefusedCommits : 1;
  const bool isNew = now >= refusal.until || refusal.reason != reason;
  if (isNew) refusal = {reason, now + kRefusalPeriod};
  if (refusal.times == most) return false;
  ++refusal.times;
  session.send(message.local_sender,
               wire::Text{.severity = wire::kTextError,
                          .level = static_cast<std::uint32_t>(ofRefusedBatch ? RefusalCode::batchRefused
                                                                             : RefusalCode::notPermitted),
                          .text = nameInTexts(message.kind) +
                                  (ofRefusedBatch ? " refused with its batch: " : " refused: ") + reason});
  return false;
}

}  // namespace hapticd::server
