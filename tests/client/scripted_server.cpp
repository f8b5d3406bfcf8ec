#include "client/scripted_server.h"

#include <future>

#include "wire/codec.h"
#include "wire/text.h"
#include "wire/udp_request.h"

namespace hapticd::test {

using namespace std::chrono_literals;

wire::Capabilities allCapabilities() {
  return {wire::kExtensionVersion,
          wire::kFeatureBulkMesh | wire::kFeatureBatch | wire::kFeatureSubscribe | wire::kFeatureStop |
              wire::kFeatureHeartbeat | wire::kFeatureHoldHand | wire::kFeatureRemoteContacts,
          1000,
          250,
          3.3,
          2,
          {-0.08, -0.06, -0.035, 0.08, 0.06, 0.035}};
}

ScriptedServer::ScriptedServer(ScriptedServerOptions options)
    : options_(std::move(options)),
      device_((names_.addSender("VRPN Control"), names_.addSender(options_.device))) {
  openPort();
  thread_ = std::thread([this] { loop_.run(); });
}

ScriptedServer::~ScriptedServer() {
  loop_.stop();
  thread_.join();
}

// TCP and UDP share one port number; another process may have the UDP port.
void ScriptedServer::openPort() {
  for (int attempt = 0;; ++attempt) {
    try {
      listener_ = std::make_unique<net::TcpListener>(
          loop_, net::Endpoint{options_.address, options_.port},
          [this](net::Connection connection) { serve(std::move(connection), false); });
      port_ = listener_->local().port;
      requests_ = std::make_unique<net::UdpSocket>(loop_, net::Endpoint{options_.address, port_});
      break;
    } catch (const net::Error&) {
      if (attempt == 20) throw;
    }
  }
  requests_->start(
      {.onDatagram =
           [this](auto bytes, const net::Endpoint&) {
             const auto request = wire::parseUdpRequest(bytes);
             if (!request) return;
             serve(net::Connection::connect(loop_, net::Endpoint::parse(request->host, request->port), 2s),
                   true);
           },
       .onRefused = {}});
}

void ScriptedServer::serve(net::Connection connection, bool withDatagrams) {
  sessions_.emplace_back();
  Session* session = &sessions_.back();
  session->connection = std::move(connection);
  if (options_.greetingBytes.empty()) {
    wire::PeerOptions peerOptions;
    if (withDatagrams) {
      session->udp = std::make_unique<net::UdpSocket>(loop_, net::Endpoint{options_.address, 0});
      session->udp->start({.onDatagram =
                               [this, session](auto bytes, const net::Endpoint&) {
                                 session->peer->feedDatagram(
                                     bytes, [&](const wire::Event& e) { onEvent(*session, e, true); });
                               },
                           .onRefused = {}});
      peerOptions.udp = wire::UdpAddress{"127.0.0.1", session->udp->local().port};
    }
    session->peer.emplace(names_, peerOptions);
    push(*session);
  } else {
    session->connection.send(wire::asBytes(options_.greetingBytes));
    session->connection.flush();
  }
  session->connection.start(
      {.onConnected = {},
       .onBytes =
           [this, session](auto bytes) {
             if (!session->peer) return;
             session->peer->feed({}, bytes, [&](const wire::Event& e) { onEvent(*session, e, false); });
             push(*session);
           },
       .onDrained = {},
       .onClosed = [this, session](
                       const std::string&) { sessions_.remove_if([&](auto& s) { return &s == session; }); }});
}

void ScriptedServer::onEvent(Session& session, const wire::Event& event, bool byDatagram) {
  if (std::holds_alternative<wire::Connected>(event)) {
    ++connections_;
    if (!options_.reads) session.connection.pauseReading();
  }
  if (const auto* udp = std::get_if<wire::UdpDescribed>(&event)) {
    session.udpPeer = net::Endpoint::parse(udp->address.host, udp->address.port);
    session.peer->useDatagrams();
  }
  const auto* message = std::get_if<wire::MessageReceived>(&event);
  if (!message || answer(session, *message)) return;
  const auto decoded = wire::decode(message->kind, message->payload);
  const std::lock_guard lock(mutex_);
  if (!decoded) {
    received_.push_back(
        {wire::Text{2, 0, decoded.error()}, std::string(message->senderName), message->time, byDatagram});
  } else if (const auto* vertex = decoded->as<wire::SetVertex>()) {
    vertices_.push_back(*vertex);
  } else {
    received_.push_back({*decoded, std::string(message->senderName), message->time, byDatagram});
  }
  changed_.notify_all();
}

// Returns whether the message is of a kind that is answered and not stored.
bool ScriptedServer::answer(Session& session, const wire::MessageReceived& message) {
  const bool ours = message.local_sender.value >= 0;
  if (message.kind == wire::kindOf<wire::Ping>) {
    ++pings_;
    if (options_.answersPings && !ignorePings_ && ours)
      session.peer->send({}, message.local_sender, wire::Pong{});
    return true;
  }
  if (message.kind == wire::kindOf<wire::QueryCapabilities>) {
    if (options_.capabilities && ours) {
      session.peer->send({}, message.local_sender, *options_.capabilities);
    }
    return true;
  }
  if (message.kind != wire::kindOf<wire::Heartbeat>) return false;
  const auto beat = wire::decode<wire::Heartbeat>(message.payload);
  if (!beat || beat->watch == 0) return false;
  ++heartbeats_;
  return true;
}

void ScriptedServer::push(Session& session) {
  if (!session.peer) return;
  const auto buffer = std::make_shared<net::Buffer>();
  session.peer->takeStream(*buffer);
  session.connection.send(buffer);
  session.connection.flush();
  session.peer->takeDatagrams([&](auto datagram) { session.udp->sendTo(datagram, *session.udpPeer); });
}

void ScriptedServer::run(std::function<void()> function) {
  std::promise<void> done;
  loop_.post([&] {
    function();
    done.set_value();
  });
  done.get_future().wait();
}

void ScriptedServer::sendOther(const std::string& type, const std::string& payload) {
  run([&] {
    const wire::LocalType id = names_.addType(type);
    for (Session& session : sessions_) {
      session.peer->sendRaw({}, device_, id, wire::asBytes(payload), wire::Reliability::kReliable);
      push(session);
    }
  });
}

void ScriptedServer::sendRawBytes(const std::string& bytes) {
  run([&] {
    for (Session& session : sessions_) {
      session.connection.send(wire::asBytes(bytes));
      session.connection.flush();
    }
  });
}

void ScriptedServer::dropClients() {
  run([&] { sessions_.clear(); });
}

void ScriptedServer::stopReading() {
  run([&] {
    for (Session& session : sessions_) session.connection.pauseReading();
  });
}

std::size_t ScriptedServer::openConnections() {
  std::size_t count = 0;
  run([&] { count = sessions_.size(); });
  return count;
}

void ScriptedServer::startReading() {
  run([&] {
    for (Session& session : sessions_) session.connection.resumeReading();
  });
}

std::vector<Received> ScriptedServer::waitReceived(std::size_t count) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, 20s, [&] { return received_.size() >= count; });
  return received_;
}

std::vector<wire::SetVertex> ScriptedServer::waitVertices(std::size_t count) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, 20s, [&] { return vertices_.size() >= count; });
  return vertices_;
}

}  // namespace hapticd::test
