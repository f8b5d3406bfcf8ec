#include "sim/simulation.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "record/difference.h"
#include "record/rerender.h"
#include "sim/replayed_scene.h"
#include "sim/simulation_run.h"

namespace hapticd::sim {
namespace {

using namespace std::chrono_literals;

}  // namespace

Simulation::Simulation(const Script& script, bool verbose)
    : script_(script),
      verbose_(verbose),
      random_(script.seed),
      scheduler_(clock_, script.seed + 7, script.adversity, [this](const auto& text) { finding(text); }),
      world_(base::World{clock_, scheduler_, files_, random_}),
      network_(scheduler_),
      log_([this](const auto& text) { logged(text); }),
      judge_({}, {.finding = [this](const auto& text) { finding(text); },
                  .freeFrom = [this] { return freeFrom(); },
                  .top = [this] { return top(); }}),
      bench_{
          .scheduler = scheduler_,
          .clock = clock_,
          .dice = Dice(script.seed + 11),
          .judge = judge_,
          .faults = script.faults,
          .ownLoop = script.ownLoop,
          .wrote =
              [this](const Vec3& force_N) {
                for (int i = 0; i < 3; ++i) hash_.add(force_N[i]);
              },
          .buttonsChanged = [this](std::uint32_t buttons) { buttons_.emplace_back(clock_.time(), buttons); },
          .finding = [this](const auto& text) { finding(text); }},
      scopedBench_(bench_),
      networkDice_(script.seed + 13),
      listeners_(scheduler_, clock_, [this](const auto& text) { finding(text); }) {
  scheduler_.onSuspended = [this] { judge_.onSuspended(clock_.time()); };
  auto& network = scheduler_.options;
  network.delay = script.networkDelay;
  network.windowBytes = script.window;
  network.jitter = [this] {
    if (script_.networkJitter == 0 || over_) return Nanos{0};
    return networkDice_.chance(0.1) ? networkDice_.between(Nanos{0}, script_.networkJitter) : Nanos{0};
  };
  network.readSize = [this](std::size_t available) -> std::size_t {
    if (available < 2 || !networkDice_.chance(0.2)) return available;
    return 1 + networkDice_.below(std::min<std::size_t>(available, 4096));
  };
  network.refusedAccept = [this](const auto& local, std::size_t pending) {
    listeners_.onRefused(local, pending);
  };
  network.losesDatagram = [this](std::uint64_t) { return networkDice_.chance(0.05); };
  const auto ofServer = [this](const net::Endpoint& local) {
    return clients_ && (local.port == clients_->server.port || local.port == clients_->web.port);
  };
  // The end of a client is at the other side only for the server.
  network.arrived = [this](const auto&, const auto& remote, std::uint64_t total) {
    if (SimClient* const client = clientAt(remote)) client->onArrived(total);
  };
  network.reads = [this, ofServer](const auto& local, const auto& remote, std::size_t size) {
    constexpr Nanos kPerByte_ps = 8'000;
    if (ofServer(local) || clientAt(remote) != nullptr)
      scheduler_.chargeNet(static_cast<Nanos>(size) * kPerByte_ps / 1000);
  };
  network.hasRead = [this](const auto&, const auto& remote, std::uint64_t total) {
    if (SimClient* const client = clientAt(remote)) client->onRead(total);
  };
}

SimClient* Simulation::clientAt(const net::Endpoint& endpoint) {
  const auto known = byPort_.find(endpoint.port);
  return known == byPort_.end() ? nullptr : known->second;
}

void Simulation::finding(const std::string& text) {
  constexpr std::size_t kMost = 5;
  if (over_) return;
  hash_.add(text);
  if (outcome_.findings.empty()) outcome_.firstFinding = clock_.time();
  if (outcome_.findings.size() < kMost) outcome_.findings.push_back(text);
  if (verbose_) std::printf("%12.6f FINDING %s\n", base::toSeconds(clock_.time()), text.c_str());
}

void Simulation::line(const std::string& text) {
  hash_.add(static_cast<std::uint64_t>(clock_.time()));
  hash_.add(text);
  if (verbose_) std::printf("%12.6f %s\n", base::toSeconds(clock_.time()), text.c_str());
}

// Within the limits of docs/limits.md, to which what the server itself reports is added.
void Simulation::logged(const std::string& text) {
  constexpr std::size_t kMost = 300'000;  // in a second
  line(text);
  if (clock_.time() - logSecond_ >= 1'000 * kMs) {
    logSecond_ = clock_.time();
    logBytes_ = 0;
  }
  logBytes_ += text.size();
  if (logBytes_ > kMost) finding("the log has more than 300 kB in a second");
  listeners_.onLogged(text);
}

void Simulation::after(Nanos delay, std::function<void()> function) {
  timers_.push_back(loop_->after(std::chrono::nanoseconds(delay), std::move(function)));
}

server::ServerConfig Simulation::configuration() const {
  server::ServerConfig config;
  config.listenAddress = "127.0.0.1";
  config.port = 3883;
  config.http = script_.web ? "127.0.0.1:8080" : server::kHttpOff;
  config.allowNoRealtime = true;
  config.tokens = "/tokens";
  config.socket = script_.local ? kSocket : server::kSocketOff;
  if (script_.record) config.record = kRecording;
  server::DeviceConfig& device = config.devices.front();
  device.enableForces = true;
  device.blackBoxDir = "/boxes";
  device.blackBoxKeep = 3;
  return config;
}

Outcome Simulation::run() {
  files_.createFolder("/boxes");
  files_.create("/tokens", base::Existing::refuse)->write("owner " + std::string(Clients::kToken) + "\n");
  scheduler_.localUser = geteuid();  // who runs the server
  server_.emplace(configuration());
  loop_.emplace();
  scheduler_.setServerLoop(kServerLoop);
  clients_.emplace(
      Clients{.loop = *loop_,
              .clock = clock_,
              .server = server_->address(),
              .web = server_->webAddress().value_or(net::Endpoint{}),
              .socket = kSocket,
              .finding = [this](const auto& text) { finding(text); },
              .stopRead = [this](Nanos at) { judge_.onStop(at); },
              .rearmRead = [this](Nanos at) { judge_.onRearm(at); },
              .netStalled = [this] { return scheduler_.netStalled(); },
              .shortOfDescriptors = [this] { return shortOfDescriptors(); },
              .heard = [this](const auto& name, const auto& text) { line(name + " hears: " + text); }});
  joinClients();
  const net::Subscription beats = loop_->every(100ms, [this] { beat(); });
  for (const Action& action : script_.actions) {
    after(action.at, [this, &action] { perform(action); });
  }
  scheduleEnd();

  server_->run();
  if (script_.record) {
    outcome_.ticks = 0;
    over_ = false;
  }
  server_.reset();
  timers_.clear();
  // A command that failed is in the recording.
  if (script_.record && !writesFailed_ && !memoryFailed_) {
    checkRecording();
    checkReplay();
  }
  sumUp();
  over_ = true;
  return outcome_;
}

void Simulation::joinClients() {
  const auto join = [this](SimClient& client) {
    client.connect();
    byPort_[client.local().port] = &client;
  };
  if (script_.cube) {
    cubeOwner_ = std::make_unique<CubeOwner>(*clients_, "owner of the cube");
    join(*cubeOwner_);
  }
  for (int i = 0; i < 2; ++i) {
    operators_.push_back(std::make_unique<Listener>(*clients_, "operator " + std::to_string(i)));
    if (i == 1) operators_.back()->kinds = wire::kReportButton;
    if (i == 1 && script_.local) operators_.back()->way = SimClient::Way::local;
    join(*operators_.back());
  }
  for (int i = 0; i < 2; ++i) {
    batchers_.push_back(std::make_unique<Batcher>(*clients_, "batcher " + std::to_string(i), 10 + 10 * i));
    join(*batchers_.back());
  }
  uploader_ = std::make_unique<Listener>(*clients_, "uploader");
  uploader_->kinds = wire::kReportButton;
  uploader_->sendsAhead = true;
  join(*uploader_);
  reader_ = std::make_unique<Listener>(*clients_, "slow reader");
  join(*reader_);
  operators_.front()->onTouched = [this] {
    constexpr Nanos kSoon = 50 * kMs;
    if (std::exchange(wakesReader_, false)) after(kSoon, [this] { resumeReader(); });
  };

  if (script_.web) {
    page_ = std::make_unique<Listener>(*clients_, "page");
    page_->way = SimClient::Way::web;
    join(*page_);
  }
  if (script_.datagrams) {
    stock_ = std::make_unique<Listener>(*clients_, "client with datagrams");
    stock_->way = SimClient::Way::datagrams;
    join(*stock_);
  }
}

// Nothing more goes wrong, the operators re-arm, and everything that was sent is applied.
void Simulation::scheduleEnd() {
  after(script_.length, [this] {
    scheduler_.calm();
    bench_.quiet = true;
    after(500 * kMs, [this] {
      if (reader_->open()) reader_->resumeReading();
    });
    healDisk();
    scheduler_.limitMemory(0);
    returnDescriptors();
    ++moving_;
    if (script_.cube) pose(y_);
    // The batch before may have failed for want of memory.
    for (const auto& batcher : batchers_) {
      if (batcher->connected()) batcher->batch();
    }
    // Behind all that it uploaded: shows at the end whether that was carried out.
    if (uploaded_ && uploader_->connected())
      uploader_->send(wire::SetTransformMatrix{kUploaded, shifted(kPlace, 0, 0)});
  });
  // What the reader misses last, it is told when it reads again.
  after(script_.length - 1'000 * kMs, [this] {
    if (reader_->open()) reader_->pauseReading();
  });
  const Nanos settled = script_.length + 1'500 * kMs +
                        (script_.adversity.sceneStall > 0 ? script_.adversity.longestSceneStall : 0) +
                        (script_.adversity.freeze > 0 ? 3'000 * kMs : 0) +
                        (script_.faults.lost > 0 ? 8'000 * kMs : 0);
  after(settled - 300 * kMs, [this] {
    if (wallSteps_ && operators_.front()->connected()) operators_.front()->stopForces();
  });
  after(settled - 200 * kMs, [this] {
    if (wallSteps_) clock_.stepWall(-5'000 * kMs);
    if (operators_.front()->connected()) operators_.front()->rearmForces();
  });
  after(settled, [this] { describe(true); });
  // Between two heartbeats: nothing else wakes the server.
  after(settled + 490 * kMs, [this] {
    const Nanos late = (judge_.ticks() - operators_.front()->lastTick) * kMs;
    if (!bench_.lost && operators_.front()->connected() && late > 30 * kMs + 2 * script_.networkDelay)
      finding("the newest report of a tick is " + std::to_string(late / kMs) + " ms old");
  });
  after(settled + 500 * kMs, [this] {
    checkEnd();
    over_ = true;
    server_->stop();
  });
}

void Simulation::sumUp() {
  outcome_.ticks = judge_.ticks();
  outcome_.ticksWithForce = judge_.ticksWithForce();
  outcome_.ticksInside = judge_.ticksInside();
  outcome_.latches = judge_.latches();
  outcome_.steps = scheduler_.steps();
  outcome_.preemptions = scheduler_.preemptions();
  outcome_.faults = scheduler_.faults() + bench_.injected;
  outcome_.stops = clients_->stops;
  outcome_.slowestStop = clients_->slowestStop;
  for (const auto& op : operators_) {
    outcome_.tickReports += op->tickReports;
    outcome_.missedReports += op->missedTicks;
  }
  hash_.add(outcome_.ticks);
  hash_.add(outcome_.tickReports);
  outcome_.hash = hash_.value();
}

void Simulation::beat() {
  revisions_.emplace_back(clock_.time(), operators_.front()->lastRevision);
  const auto one = [](Listener& client) {
    if (!client.connected() || !client.beats) return;
    client.send(wire::Heartbeat{});
    client.watched = true;
  };
  if (cubeOwner_) one(*cubeOwner_);
  for (const auto& client : operators_) one(*client);
  for (const auto& client : batchers_) one(*client);
  for (const auto& client : pushers_) one(*client);
  one(*uploader_);
  one(*reader_);
  if (page_) one(*page_);
  if (stock_) one(*stock_);
  for (const auto& client : newcomers_) one(*client);
}

void Simulation::describe(bool last) {
  ++unanswered_;
  server_->stations().front()->scene().describe([this, last](const auto& description) {
    --unanswered_;
    if (description || !memoryFailed_) compare(*description, last);
  });
}

// Both objects of a batcher are at the same batch, and at the last one in the end.
void Simulation::compare(const scene::SceneDescription& description, bool last) {
  compared_ = compared_ || last;
  const auto find = [&](std::int32_t id) -> const scene::ObjectDescription* {
    for (const auto& object : description.objects) {
      if (object.id == id) return &object;
    }
    return nullptr;
  };
  for (const auto& batcher : batchers_) {
    const auto* const a = find(batcher->first);
    const auto* const b = find(batcher->first + 1);
    if (a == nullptr || b == nullptr) {
      if (last) finding("an object of '" + batcher->name() + "' is missing at the end");
      continue;
    }
    const auto number = [](const scene::ObjectDescription& object) {
      return static_cast<std::int64_t>(std::lround(object.T_world_object.translation().z() / 10));
    };
    std::int64_t& seen = seen_[batcher->first];
    // A commit that finds no memory is carried out in part, with a text.
    const bool together = number(*a) == number(*b) || batcher->sent == 0 || clock_.time() < memoryShortUntil_;
    if (!together || number(*a) < seen || number(*a) > batcher->sent || (last && number(*a) != batcher->sent))
      finding("objects of '" + batcher->name() + "' are at the batches " + std::to_string(number(*a)) +
              " and " + std::to_string(number(*b)) + ", earlier " + std::to_string(seen) + ", sent " +
              std::to_string(batcher->sent));
    seen = number(*a);
  }
  if (last && uploaded_) {
    const auto* const object = find(kUploaded);
    if (object == nullptr || std::abs(object->T_world_object.translation().x() - kPlace) > 1e-9)
      finding("what the uploader sent last has not been carried out");
  }
  if (!last || !cubeOwner_ || !cubeOwner_->uploaded) return;
  const auto* const object = find(0);
  if (object == nullptr || std::abs(object->T_world_object.translation().y() - y_) > 1e-9)
    finding("the cube is not where its owner has moved it to last");
}

void Simulation::checkEnd() {
  if (!compared_) finding("the scene thread has not described the scene within 500 ms");
  if (compared_ && unanswered_ > 0)
    finding("the scene thread has not answered " + std::to_string(unanswered_) +
            " requests for a description that are older than one that it has answered");
  const bool running = judge_.ticks() > 0;
  const Listener& op = *operators_.front();
  // What never comes back would fulfil every other promise.
  if (bench_.lost ? op.tickReports == 0 : op.lastTick + 100 < judge_.ticks())
    finding("the newest tick that was reported is " + std::to_string(op.lastTick) + " of " +
            std::to_string(judge_.ticks()));
  if (!bench_.lost && judge_.sinceRead(clock_.time()) > 100 * kMs)
    finding("the servo does not tick at the end");
  if (!bench_.lost && (op.guard.stopped != 0 || op.guard.latched != 0))
    finding("the forces are still off after the last re-arm");
  const auto check = [&](Listener& client) {
    if (!client.connected()) {
      finding("client '" + client.name() + "' is not connected at the end");
      return;
    }
    for (std::size_t i = 0; i < client.buttons.size() && running; ++i) {
      // The newest change may still be on its way.
      const Nanos since = clock_.time() - 60 * kMs;
      bool known = (client.kinds & wire::kReportButton) == 0;
      for (auto state = buttons_.rbegin(); state != buttons_.rend() && !known; ++state) {
        known = client.buttons[i] == ((state->second >> i) & 1U);
        if (state->first < since) break;
      }
      if (!known)
        finding("client '" + client.name() + "' does not know the last state of button " + std::to_string(i));
    }
    const bool stopped = (client.guard.stopped != 0);
    if (client.guardReports > 0 && operators_.front()->guardReports > 0 &&
        stopped != (operators_.front()->guard.stopped != 0))
      finding("clients disagree whether forces are stopped");
  };
  if (cubeOwner_) check(*cubeOwner_);
  for (const auto& client : operators_) check(*client);
  for (const auto& client : batchers_) check(*client);
  check(*uploader_);
  check(*reader_);
  if (page_) check(*page_);
  if (stock_) check(*stock_);
  checkVisits();
}

void Simulation::checkRecording() {
  scheduler_.calm();
  std::string remark;
  std::string law;
  try {
    for (const record::Difference& device : record::compare(kRecording, {}, remark, law)) {
      outcome_.replayedTicks += device.ticks();
      if (device.lost() == 0 && device.same() != device.ticks())
        finding("the recording replays " + std::to_string(device.same()) + " of " +
                std::to_string(device.ticks()) + " ticks bit for bit");
    }
  } catch (const std::exception& error) {
    finding(std::string("the recording cannot be replayed: ") + error.what());
  }
  if (!remark.empty()) finding("the recording ends early: " + remark);
}

// A server replays the recording, and somebody seeks in it, sometimes again before the scene of the seek
// before is complete: each time it shows the scene of then.
void Simulation::checkReplay() {
  constexpr int kChecks = 3;
  constexpr Nanos kShown = 200 * kMs;  // how far a paused replay goes on to show a tick
  // The clients learn that their server ended.
  over_ = true;
  scheduler_.runUntil(clock_.time() + 2'000 * kMs);
  over_ = false;
  const ReplayedScene scene(kRecording);
  auto player = std::make_unique<server::Player>(server::ReplayOptions{.file = kRecording});
  server::ServerConfig config = player->config();
  config.http = server::kHttpOff;
  config.socket = server::kSocketOff;
  ++config.port;
  scheduler_.setServerLoop(scheduler_.loops());
  server_.emplace(config, std::move(player));
  clients_->server = server_->address();
  SimClient seeker(*clients_, "seeker");
  seeker.identifies = false;
  seeker.connect();
  Dice dice(script_.seed + 17);
  const Nanos settles = 1'000 * kMs + script_.adversity.longestSceneStall;
  Nanos at = 100 * kMs;
  for (int i = 0; i < kChecks; ++i) {
    after(at, [this] { scheduler_.calm(false); });
    Nanos moment = scene.drawTime(dice);
    const auto seek = [&] {
      after(at, [&seeker, moment] {
        seeker.send(wire::ReplayControl{.paused = 1, .speed = 0, .position = base::toSeconds(moment)});
      });
    };
    seek();
    if (dice.chance(0.75)) {
      at += dice.between(kMs, 20 * kMs);
      // Of what came first, most is sent outside batches.
      moment = dice.chance(0.5) ? scene.drawTime(dice) : dice.between(0, 2'000 * kMs);
      seek();
    }
    after(at, [this] { scheduler_.calm(); });
    at += settles;
    after(at, [this, &scene, moment] {
      server_->stations().front()->scene().describe([this, &scene, moment](const auto& description) {
        ++outcome_.seeks;
        const std::string text = scene.difference(*description, moment, moment + kShown);
        if (!text.empty())
          finding("after a seek to " + std::to_string(base::toSeconds(moment)) + " s in the recording, " +
                  text);
      });
    });
    at += 100 * kMs;
  }
  after(at, [this] { server_->stop(); });
  server_->run();
  if (outcome_.seeks != kChecks) finding("a replay has not described its scene");
  server_.reset();
  timers_.clear();
}

Outcome run(const Script& script, bool verbose, std::vector<std::byte>* recording) {
  Simulation simulation(script, verbose);
  Outcome outcome = simulation.run();
  if (recording != nullptr && script.record) *recording = simulation.recording();
  return outcome;
}

}  // namespace hapticd::sim
