// hapticd tunnel: a local port whose connections travel to a server on another machine through TLS.
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <list>
#include <memory>
#include <optional>
#include <string>

#include "client/host_lookup.h"
#include "client/server_address.h"
#include "commands.h"
#include "hapticd/error.h"
#include "net/connection.h"
#include "net/local_socket.h"
#include "net/tcp_listener.h"
#include "net/udp_socket.h"
#include "server/session/throttled_log.h"
#include "stop_signals.h"
#include "tls/tls.h"
#include "token_file.h"
#include "wire/bytes.h"
#include "wire/codec.h"
#include "wire/cookie.h"
#include "wire/frame.h"
#include "wire/system.h"

namespace hapticd::apps {
namespace {

using namespace std::chrono_literals;

struct TunnelOptions {
  std::string server;
  int port = client::kDefaultPort;
  std::string fingerprint;
  std::string authorities;
  std::string tokenFile;
};

// Numbers that a client describes last, if ever: the names of what the tunnel says itself.
constexpr std::int32_t kOwnNumber = 1990;

void appendFrame(net::Buffer& bytes, std::int32_t sender, std::int32_t type, wire::ByteView payload) {
  const std::size_t at = bytes.size();
  bytes.resize(at + wire::kHeaderBytes + wire::padded(payload.size()));
  std::byte* const out = bytes.data() + at;
  wire::storeBig(out, static_cast<std::int32_t>(wire::kHeaderBytes + payload.size()));
  wire::storeBig(out + 12, sender);
  wire::storeBig(out + 16, type);
  std::copy(payload.begin(), payload.end(), out + wire::kHeaderBytes);
}

// Frames that present a token, for the place behind a client's cookie: stock clients cannot.
net::Buffer identification(const std::string& token) {
  net::Buffer bytes;
  appendFrame(bytes, kOwnNumber, wire::kSenderDescription, wire::encodeDescription("VRPN Control"));
  appendFrame(bytes, kOwnNumber, wire::kTypeDescription, wire::encodeDescription(wire::Identify::kInfo.name));
  const wire::Identify identify{.token = std::string_view(token), .key = 0};
  net::Buffer payload(wire::payloadSize(identify));
  wire::encodePayload(identify, payload.data());
  appendFrame(bytes, kOwnNumber, kOwnNumber, payload);
  return bytes;
}

// One client and its connection to the server. Each side is read as fast as the other one takes it. The end
// of the client travels to the server behind all that it sent, and it sees the end of its own connection only
// then.
class Carrier : public std::enable_shared_from_this<Carrier> {
 public:
  Carrier(net::Connection near, net::Connection far, net::Buffer afterCookie,
          std::function<void(const std::string& why)> onGone)
      : near_(std::move(near)),
        far_(std::move(far)),
        afterCookie_(std::move(afterCookie)),
        onGone_(std::move(onGone)) {}

  void start() {
    net::ConnectionHandlers near = handlers(near_, far_, true);
    near.onPeerEnded = [this, self = shared_from_this()] { far_.close("closed by the client"); };
    near_.start(std::move(near));
    net::ConnectionHandlers far = handlers(far_, near_, false);
    far.onPeerGone = [this, self = shared_from_this()](const std::string& why) { end(why); };
    far_.start(std::move(far));
  }

  void end(const std::string& why) {
    if (!onGone_) return;
    near_.close(why);
    far_.close(why);
    std::exchange(onGone_, nullptr)(why);
  }

 private:
  static constexpr std::size_t kMostQueued = std::size_t{1} << 19;

  net::ConnectionHandlers handlers(net::Connection& from, net::Connection& to, bool ofClient) {
    return {.onBytes =
                [this, self = shared_from_this(), &from, &to, ofClient](auto bytes) {
                  carry(from, to, ofClient ? withToken(bytes) : net::Buffer(bytes.begin(), bytes.end()));
                },
            // The queue of this connection is empty: its feeder may go on.
            .onDrained = [self = shared_from_this(), &to] { to.resumeReading(); },
            .onClosed = [this, self = shared_from_this()](const std::string& why) { end(why); }};
  }

  net::Buffer withToken(std::span<const std::byte> bytes) {
    net::Buffer out;
    const std::size_t left = wire::kCookieBytes - std::min(wire::kCookieBytes, seen_);
    const std::size_t cookie = std::min(left, bytes.size());
    seen_ += bytes.size();
    out.insert(out.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(cookie));
    if (left > 0 && seen_ >= wire::kCookieBytes)
      out.insert(out.end(), afterCookie_.begin(), afterCookie_.end());
    out.insert(out.end(), bytes.begin() + static_cast<std::ptrdiff_t>(cookie), bytes.end());
    return out;
  }

  void carry(net::Connection& from, net::Connection& to, net::Buffer bytes) {
    to.send(std::make_shared<const net::Buffer>(std::move(bytes)));
    to.flush();
    if (to.statistics().queuedBytes > kMostQueued) from.pauseReading();
  }

  net::Connection near_;
  net::Connection far_;
  const net::Buffer afterCookie_;
  std::size_t seen_ = 0;
  std::function<void(const std::string& why)> onGone_;
};

tls::Context contextOf(const TunnelOptions& options, const std::string& host) {
  if (!options.authorities.empty()) return tls::Context::clientThatTrusts(options.authorities, host);
  if (!options.fingerprint.empty()) return tls::Context::clientThatKnows(options.fingerprint);
  throw std::runtime_error(
      "how should the tunnel know that " + host +
      " is the right server? Give --fingerprint, which that server prints at its start, or "
      "--ca with the authority that signed its certificate");
}

// The server at the far end: through TLS, or a Unix socket of this machine.
class FarEnd {
 public:
  // Throws when the server does not answer: a wrong fingerprint is told here and not to the first client.
  FarEnd(net::Loop& loop, const TunnelOptions& options, const net::ConnectionOptions& link)
      : loop_(loop), server_(client::parseServer(options.server)), link_(link) {
    if (server_.socket.empty()) {
      context_ = contextOf(options, server_.host);
      host_.emplace(server_.host);
      tryOnce();
      return;
    }
    if (!(options.fingerprint + options.authorities).empty())
      throw std::runtime_error(name() + " is a socket of this machine, without TLS: leave out " +
                               (options.fingerprint.empty() ? "--ca" : "--fingerprint"));
    connect();
  }

  // Throws net::Error when there is no such Unix socket.
  net::Connection connect() {
    if (!context_) return net::connectLocal(loop_, server_.socket, link_);
    const net::Endpoint address{host_->address(), server_.port};
    host_->askAgain();  // a client that fails tries again, then with the answer
    return tls::wrap(*context_, net::Connection::connect(loop_, address, 3s, link_));
  }
  std::string name() const { return server_.text(); }

 private:
  void tryOnce() {
    bool answered = false;
    std::optional<std::string> failure;
    net::Connection connection = connect();
    connection.start({.onConnected = [&] { answered = true; },
                      .onBytes = [](auto) {},
                      .onDrained = {},
                      .onPeerGone = {},
                      .onClosed = [&](const std::string& why) { failure = why; }});
    const auto end = std::chrono::steady_clock::now() + 5s;
    while (!answered && !failure && std::chrono::steady_clock::now() < end) loop_.runOnce(100ms);
    if (!answered) throw ConnectError(name() + ": " + failure.value_or("no TLS handshake within 5 s"));
  }

  net::Loop& loop_;
  const client::ServerAddress server_;
  const net::ConnectionOptions link_;
  std::optional<tls::Context> context_;
  std::optional<client::HostLookup> host_;
};

// The local port, with a Carrier for each client.
class Tunnel {
 public:
  explicit Tunnel(const TunnelOptions& options)
      : token_(options.tokenFile.empty() ? net::Buffer() : identification(readToken(options.tokenFile))),
        farEnd_(loop_, options, kLink),
        listener_(
            loop_, {net::kLoopbackAddress, static_cast<std::uint16_t>(options.port)},
            [this](net::Connection near) { carry(std::move(near)); }, kLink, "--port"),
        requests_(loop_, listener_.local()) {
    requests_.start(
        {.onDatagram = [this](auto, const net::Endpoint& from) { refuseCallBack(from); }, .onRefused = {}});
  }

  void run() {
    std::printf("clients open NAME@tcp://%s; connections go to %s\n", listener_.local().text().c_str(),
                farEnd_.name().c_str());
    std::fflush(stdout);
    auto reportedAt = std::chrono::steady_clock::now();
    while (!stopRequested()) {
      loop_.runOnce(200ms);
      const auto now = std::chrono::steady_clock::now();
      if (now - reportedAt < 1s) continue;
      reportedAt = now;
      log_.reportSuppressed();
    }
    for (const std::shared_ptr<Carrier>& carrier : std::list(carriers_)) carrier->end("the tunnel ends");
    loop_.runOnce(0ms);  // forgets them
  }

 private:
  static constexpr net::ConnectionOptions kLink{
      .keepAlive = 1s,
      .closeTimeout = 24h,  // as long as the peer takes what is queued: nobody waits for it
  };

  void carry(net::Connection near) {
    net::Connection far;
    try {
      far = farEnd_.connect();
    } catch (const net::Error& error) {  // the Unix socket is gone
      return tell(error.what());
    }
    carriers_.emplace_back();
    const auto place = std::prev(carriers_.end());
    *place = std::make_shared<Carrier>(std::move(near), std::move(far), token_,
                                       [this, place](const std::string& why) {
                                         tell(why);
                                         // After its last callback, and with time to send what is queued.
                                         loop_.post([this, place] { carriers_.erase(place); });
                                       });
    (*place)->start();
  }

  void tell(const std::string& why) { log_.warnOfLasting("client disconnected: " + why); }

  void refuseCallBack(const net::Endpoint& from) {
    if (std::exchange(toldOfCallBack_, true)) return;
    std::fprintf(stderr,
                 "hapticd: %s asks for a call-back: the tunnel carries tcp:// only, open NAME@tcp://%s\n",
                 from.text().c_str(), listener_.local().text().c_str());
  }

  server::ThrottledLog log_;  // a client tries again while the server cannot be reached
  const net::Buffer token_;
  net::Loop loop_;
  FarEnd farEnd_;
  std::list<std::shared_ptr<Carrier>> carriers_;
  net::TcpListener listener_;
  net::UdpSocket requests_;
  bool toldOfCallBack_ = false;
};

int run(const TunnelOptions& options) {
  spdlog::set_default_logger(spdlog::stderr_logger_st("tunnel"));
  spdlog::set_pattern("hapticd: %v");
  Tunnel tunnel(options);
  const StopSignals signals;
  tunnel.run();
  return 0;
}

}  // namespace

void addTunnel(CLI::App& app) {
  auto options = std::make_shared<TunnelOptions>();
  CLI::App* command =
      app.add_subcommand("tunnel", "Carry clients on this machine to a server on another one, through TLS");
  command->add_option("server", options->server, "HOST[:PORT], or unix:/PATH on this machine")->required();
  command->add_option("--port", options->port, "Local port [3883]; 0: any free one")
      ->check(withinIntegers(0, 65535));
  CLI::Option* const known =
      command->add_option("--fingerprint", options->fingerprint,
                          "SHA-256 of the server's certificate, which it prints at its start");
  command->add_option("--ca", options->authorities, "PEM file of the authority that signed the certificate")
      ->check(existingFile())
      ->excludes(known);
  command
      ->add_option("--token-file", options->tokenFile,
                   "Present the token in this file, mode 0600, for each client")
      ->check(existingFile());
  command->footer(
      "For clients that know neither TLS nor tokens, such as those of stock VRPN: they open\n"
      "NAME@tcp://127.0.0.1:3883. Everybody on this machine can use the tunnel while it runs. It ends with\n"
      "status 1 when the server does not answer at its start.");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps
