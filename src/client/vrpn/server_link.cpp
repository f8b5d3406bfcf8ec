#include "client/vrpn/server_link.h"

#include <algorithm>
#include <cstdio>

#include "wire/text.h"
#include "wire/udp_request.h"

namespace hapticd::client {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kFlush_bytes = 64 * 1024;
constexpr std::size_t kMostCalling = 64;
constexpr int kPortAttempts = 20;
constexpr std::size_t kMostNamesOfClient = 200;
constexpr std::size_t kMostNamesOfClients = 1000;

}  // namespace

ServerLink::ServerLink(const std::optional<net::Endpoint>& local) {
  if (local) listen(*local);
}

// Requests arrive by datagram at the port of the stream. When the system chooses it, the other may be taken.
void ServerLink::listen(const net::Endpoint& local) {
  for (int attempt = 1;; ++attempt) {
    listener_.emplace(
        loop_, local, [this](net::Connection connection) { add(std::move(connection), false); },
        net::ConnectionOptions{}, "vrpn_create_server_connection()");
    try {
      requests_.emplace(loop_, net::Endpoint{local.address, listener_->local().port});
      break;
    } catch (const net::Error&) {
      if (local.port != 0 || attempt == kPortAttempts) throw;
    }
  }
  requests_->start({.onDatagram = [this](auto bytes, const net::Endpoint& from) { onRequest(bytes, from); },
                    .onRefused = {}});
}

std::uint16_t ServerLink::port() const noexcept {
  return listener_ ? listener_->local().port : 0;
}

// Connects only to the sender of the request, so that a forged one cannot make this program call others.
void ServerLink::onRequest(wire::ByteView bytes, const net::Endpoint& from) {
  const auto request = wire::parseUdpRequest(bytes);
  if (!request || calling_.size() >= kMostCalling) return;
  net::Endpoint client;
  try {
    client = net::Endpoint::parse(request->host, request->port);
  } catch (const net::Error&) {
    return;
  }
  const auto loopback = [](const net::Endpoint& end) { return net::isLoopback(end.address); };
  if (client.address != from.address && !(loopback(client) && loopback(from))) return;
  const auto known = [&](const net::Connection& connection) { return connection.remote() == client; };
  if (std::any_of(calling_.begin(), calling_.end(), known)) return;
  const auto entry = calling_.insert(calling_.end(), net::Connection::connect(loop_, client, 2s));
  entry->start({.onConnected =
                    [this, entry] {
                      net::Connection connection = std::move(*entry);
                      calling_.erase(entry);
                      add(std::move(connection), true);
                    },
                .onBytes = {},
                .onDrained = {},
                .onClosed = [this, entry](const std::string&) { calling_.erase(entry); }});
}

void ServerLink::add(net::Connection connection, bool datagrams) {
  Client& client = clients_.emplace_back();
  client.connection = std::move(connection);
  wire::PeerOptions options;
  if (datagrams) {
    try {
      const net::Endpoint local{client.connection.local().address, 0};
      client.udp.emplace(loop_, local);
      client.udp->start({.onDatagram =
                             [this, &client](auto bytes, const net::Endpoint& from) {
                               if (from.address != client.connection.remote().address) return;
                               client.peer->feedDatagram(
                                   bytes, [&](const wire::Event& event) { onEvent(client, event); });
                             },
                         .onRefused = {}});
      options.udp = wire::UdpAddress{local.addressText(), client.udp->local().port};
    } catch (const net::Error&) {
      client.udp.reset();  // then everything is sent by TCP
    }
  }
  client.peer.emplace(names_, options);
  client.connection.start(
      {.onConnected = {},
       .onBytes =
           [this, &client](auto bytes) {
             client.peer->feed(wireNow(), bytes, [&](const wire::Event& event) { onEvent(client, event); });
             flush(client);
           },
       .onDrained = {},
       .onClosed = [this, &client](const std::string& reason) { onClosed(client, reason); }});
  flush(client);
}

void ServerLink::onEvent(Client& client, const wire::Event& event) {
  if (std::get_if<wire::Connected>(&event) != nullptr) {
    inbox_.push({.what = Arrival::What::connected, .arrived = wallTimePoint()});
    client.announced = true;
  } else if (const auto* sender = std::get_if<wire::SenderDescribed>(&event)) {
    adoptSender(client, sender->name);
  } else if (const auto* type = std::get_if<wire::TypeDescribed>(&event)) {
    adoptType(client, type->name);
  } else if (const auto* udp = std::get_if<wire::UdpDescribed>(&event)) {
    onUdpDescribed(client, udp->address);
  } else if (const auto* message = std::get_if<wire::MessageReceived>(&event)) {
    wire::LocalSender from = message->local_sender;
    if (from.value < 0) from = names_.findSender(message->senderName).value_or(wire::LocalSender{});
    const auto local = message->kind != wire::kUnknownKind
                           ? wire::localType(message->kind)
                           : names_.findType(message->typeName).value_or(wire::LocalType{});
    if (from.value < 0 || local.value < 0) return;
    inbox_.push({.what = Arrival::What::message,
                 .kind = message->kind,
                 .sender = from,
                 .type = local,
                 .time = message->time,
                 .arrived = wallTimePoint(),
                 .bytes = message->payload});
  } else if (const auto* error = std::get_if<wire::ProtocolError>(&event)) {
    std::fprintf(stderr, "VRPN: %s broke the protocol: %.*s\n", client.connection.remote().text().c_str(),
                 static_cast<int>(error->reason.size()), error->reason.data());
    client.connection.abort("it broke the VRPN protocol");
  }
}

// The description replaces an earlier one. A client may name its own address only: others did not ask.
void ServerLink::onUdpDescribed(Client& client, const wire::UdpAddress& address) {
  client.udpPeer.reset();
  client.peer->useDatagrams(false);
  if (!client.udp) return;
  try {
    const net::Endpoint described = net::Endpoint::parse(address.host, address.port);
    if (described.address != client.connection.remote().address) return;
    client.udpPeer = described;
    client.peer->useDatagrams();
  } catch (const net::Error&) {
    // Not a numeric address: everything is sent by TCP.
  }
}

void ServerLink::onClosed(Client& client, const std::string& reason) {
  if (client.announced) {
    inbox_.push({.what = Arrival::What::lost, .arrived = wallTimePoint(), .bytes = wire::asBytes(reason)});
  }
  clients_.remove_if([&](const Client& entry) { return &entry == &client; });
}

// The names of all clients are in one table, which is announced to all of them and never shrinks. The names
// of the program itself, and those that the next client describes, need room, too.
bool ServerLink::mayAdopt(Client& client) {
  if (client.adopted >= kMostNamesOfClient || adopted_ >= kMostNamesOfClients) return false;
  ++client.adopted;
  ++adopted_;
  return true;
}

// One that is left out stays unmapped, and so do its messages.
void ServerLink::adoptSender(Client& client, std::string_view name) {
  try {
    if (!names_.findSender(name) && mayAdopt(client)) names_.addSender(name);
  } catch (const std::logic_error&) {
    // An invalid name, or one too many.
  }
}

void ServerLink::adoptType(Client& client, std::string_view name) {
  try {
    if (!names_.findType(name) && mayAdopt(client)) names_.addType(name);
  } catch (const std::logic_error&) {
    // An invalid name, or one too many.
  }
}

void ServerLink::send(wire::Time time, wire::LocalSender sender, wire::LocalType type, wire::ByteView payload,
                      wire::Reliability reliability) {
  for (Client& client : clients_) client.peer->sendRaw(time, sender, type, payload, reliability);
  uncounted_ += wire::kHeaderBytes + wire::padded(payload.size());
  if (uncounted_ > kFlush_bytes) flush();
}

void ServerLink::flush() {
  uncounted_ = 0;
  for (Client& client : clients_) flush(client);
}

void ServerLink::flush(Client& client) {
  std::vector<std::byte> bytes;
  client.peer->takeStream(bytes);
  if (!bytes.empty()) client.connection.send(std::make_shared<const net::Buffer>(std::move(bytes)));
  client.connection.flush();
  if (!client.udp || !client.udpPeer) return;
  client.peer->takeDatagrams([&](wire::ByteView datagram) { client.udp->sendTo(datagram, *client.udpPeer); });
}

std::size_t ServerLink::poll(Duration timeout, const Link::Handler& handler) {
  if (dispatching_) return 0;
  flush();
  loop_.runOnce(timeout);
  struct Dispatching {
    explicit Dispatching(bool& flag_) : flag(flag_) { flag = true; }
    ~Dispatching() { flag = false; }
    bool& flag;
  } guard(dispatching_);
  std::size_t count = 0;
  for (Arrival arrival; inbox_.pop(arrival); ++count) handler(arrival);
  flush();
  return count;
}

}  // namespace hapticd::client
