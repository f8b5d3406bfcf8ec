// Sequences of messages from several clients through a whole server in the simulated world of hapticd-sim, up
// to the force on the hand: it keeps its promises (sim::Judge), another client that does nothing wrong is
// served as before, and once the scene is reset and all the others are gone, no force is left.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fuzz/targets.h"
#include "server/server.h"
#include "sim/clients.h"
#include "sim/judge.h"
#include "sim/scheduler.h"
#include "sim/sim_device.h"
#include "wire/message.h"

namespace hapticd::fuzz {
namespace {

using namespace std::chrono_literals;
using base::Nanos;
using sim::kMs;

constexpr int kMostRecords = 64;
constexpr Nanos kLongest = 600 * kMs;  // of the clients
constexpr Nanos kRelease = 400 * kMs;  // after it nothing of a client that is gone is left

// Four bytes before the payload.
struct Record {
  unsigned client;  // 0 and 1 own the device, 2 does not, 3 is a page
  enum class What { message, wait, reset, bytes } what;
  wire::MessageKind kind;
  std::size_t length;
  explicit Record(Input head)
      : client(static_cast<unsigned>(head[0]) & 3U),
        what(static_cast<What>((static_cast<unsigned>(head[0]) >> 2U) & 3U)),
        kind{static_cast<std::uint8_t>(static_cast<unsigned>(head[1]) % wire::kMessageKinds)},
        length(static_cast<std::size_t>(head[2]) << 8U | static_cast<std::size_t>(head[3])) {}
};

// As sent, or cut and padded to the size of that kind, which few mutations keep.
std::optional<wire::Message> messageOf(wire::MessageKind kind, Input payload) {
  if (wire::Result<wire::Message> message = wire::decode(kind, payload)) return std::move(*message);
  std::vector<std::byte> fitting(wire::payloadSize(wire::Message(kind)));
  std::copy_n(payload.begin(), std::min(payload.size(), fitting.size()), fitting.begin());
  if (wire::Result<wire::Message> message = wire::decode(kind, fitting)) return std::move(*message);
  return std::nullopt;
}

class Session {
 public:
  explicit Session(Input input) : input_(input), network_(scheduler_), scoped_(bench_) {
    files_.create("/tokens", base::Existing::refuse)
        ->write("owner " + std::string(sim::Clients::kToken) + "\n");
    server::ServerConfig config;
    config.listenAddress = "127.0.0.1";
    config.port = 3883;
    config.http = "127.0.0.1:8080";
    config.socket = server::kSocketOff;
    config.allowNoRealtime = true;
    config.tokens = "/tokens";
    config.devices.front().enableForces = true;
    server_.emplace(config);
    loop_.emplace();
    scheduler_.setServerLoop(0);
    scheduler_.options.arrived = [this](const auto&, const auto& remote, std::uint64_t total) {
      if (sim::SimClient* const client = at(remote)) client->onArrived(total);
    };
    scheduler_.options.hasRead = [this](const auto&, const auto& remote, std::uint64_t total) {
      if (sim::SimClient* const client = at(remote)) client->onRead(total);
    };
    all_.emplace(sim::Clients{.loop = *loop_,
                              .clock = clock_,
                              .server = server_->address(),
                              .web = server_->webAddress().value_or(net::Endpoint{}),
                              .finding = finding_,
                              .stopRead = [this](Nanos at) { judge_.onStop(at); },
                              .rearmRead = [this](Nanos at) { judge_.onRearm(at); },
                              .netStalled = [this] { return scheduler_.netStalled(); },
                              .shortOfDescriptors = [] { return false; },
                              .heard = [](const auto&, const auto&) {}});
    witness_.emplace(*all_, "witness");
    witness_->connect();
  }

  void run() {
    const net::Subscription beats = loop_->every(100ms, [this] {
      if (witness_->connected()) witness_->send(wire::Heartbeat{});
    });
    input_ = input_.subspan(std::min<std::size_t>(1, input_.size()));
    after(5 * kMs, [this] { next(); });
    server_->run();
  }

 private:
  void after(Nanos delay, std::function<void()> function) {
    timers_.push_back(loop_->after(std::chrono::nanoseconds(delay), std::move(function)));
  }
  sim::SimClient* at(const net::Endpoint& remote) {
    if (witness_ && witness_->local().port == remote.port) return &*witness_;
    for (const auto& client : clients_) {
      if (client && client->local().port == remote.port) return client.get();
    }
    return nullptr;
  }

  sim::SimClient& client(unsigned number) {
    auto& client = clients_.at(number);
    if (client && client->open()) return *client;
    client = std::make_unique<sim::SimClient>(*all_, "client " + std::to_string(number));
    client->identifies = number != 2;
    if (number == 3) client->way = sim::SimClient::Way::web;
    client->connect();
    client->expectEnd();
    return *client;
  }

  void next() {
    if (input_.size() < 4 || records_++ == kMostRecords || clock_.now() > kLongest) return end();
    const Record record(input_);
    input_ = input_.subspan(4);
    if (record.what == Record::What::wait) {
      return after(static_cast<Nanos>(record.length % 100) * kMs, [this] { next(); });
    }
    const Input payload = input_.first(std::min(record.length, input_.size()));
    input_ = input_.subspan(payload.size());
    sim::SimClient& from = client(record.client);
    switch (record.what) {
      case Record::What::reset:
        from.reset();
        break;
      case Record::What::bytes:
        // Nothing after these is sure to be understood.
        from.sendBytes(payload);
        break;
      default:
        if (!from.connected()) return greet(record, payload, 0);
        send(from, record, payload);
    }
    after(kMs / 2, [this] { next(); });
  }

  // The handshake of a new client takes some round trips.
  void greet(const Record& record, Input payload, int tries) {
    sim::SimClient& from = client(record.client);
    if (from.connected()) {
      send(from, record, payload);
    } else if (tries < 8) {
      return after(kMs, [this, record, payload, tries] { greet(record, payload, tries + 1); });
    }
    next();
  }

  void send(sim::SimClient& from, const Record& record, Input payload) {
    // The judge knows who stops and who re-arms.
    if (record.kind == wire::kindOf<wire::StopForces>) return from.stopForces();
    if (record.kind == wire::kindOf<wire::RearmForces>) return from.rearmForces();
    if (const auto message = messageOf(record.kind, payload)) from.queue(*message);
    from.flush();
  }

  void end() {
    for (const auto& client : clients_) {
      if (client && client->open()) client->reset();
    }
    require(witness_->connected(), "a client that does nothing wrong stays connected");
    witness_->send(wire::ResetScene{});
    freeFrom_ = clock_.now() + kRelease;
    after(kRelease + 30 * kMs, [this] {
      require(witness_->connected(), "a client that does nothing wrong stays connected");
      require(witness_->lastTick + 30 > judge_.ticks(), "ticks are reported in time");
      witness_->stopForces();
    });
    after(kRelease + 60 * kMs, [this] {
      require(witness_->guard.stopped != 0, "a stop is reported");
      witness_->rearmForces();
    });
    after(kRelease + 90 * kMs, [this] {
      require(witness_->guard.stopped == 0 && witness_->guard.latched == 0, "a re-arm is obeyed");
      server_->stop();
    });
  }

  const std::function<void(const std::string&)> finding_ = [](const std::string& text) {
    require(false, text.c_str());
  };
  Input input_;
  int records_ = 0;
  sim::SimClock clock_{base::FakeWorld::kWallAtZero};
  base::SeededRandom random_{1};
  base::FakeFiles files_;
  sim::Scheduler scheduler_{clock_, 1, {.preempt = 0}, finding_};
  base::ScopedWorld world_{base::World{clock_, scheduler_, files_, random_}};
  net::ScopedNetwork network_;
  std::optional<Nanos> freeFrom_;
  sim::Judge judge_{{},
                    {.finding = finding_,
                     .freeFrom = [this] { return freeFrom_; },
                     .top = [] { return std::optional<sim::Judge::Top>(); }}};
  sim::Bench bench_{.scheduler = scheduler_,
                    .clock = clock_,
                    .dice = sim::Dice(selector(input_)),  // draws the path of the hand
                    .judge = judge_,
                    .faults = {},
                    .wrote = [](const auto&) {},
                    .buttonsChanged = [](std::uint32_t) {},
                    .finding = finding_};
  sim::ScopedBench scoped_;
  std::optional<server::Server> server_;
  std::optional<net::Loop> loop_;
  std::optional<sim::Clients> all_;
  std::optional<sim::Listener> witness_;
  std::array<std::unique_ptr<sim::SimClient>, 4> clients_;
  std::vector<net::Subscription> timers_;
};

}  // namespace

void whole_server(Input input) {
  static const bool silent = [] {
    setenv("HAPTICD_EMBREE", "threads=1,user_threads=1", 0);
    spdlog::set_level(spdlog::level::off);
    return true;
  }();
  static_cast<void>(silent);
  Session(input).run();
}

}  // namespace hapticd::fuzz
