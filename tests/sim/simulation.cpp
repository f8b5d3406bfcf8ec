#include "sim/simulation.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <deque>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "record/difference.h"
#include "record/rerender.h"
#include "server/server.h"
#include "sim/clients.h"
#include "sim/hash.h"
#include "sim/listener_judge.h"
#include "sim/replayed_scene.h"
#include "sim/scoped_log.h"
#include "sim/visit.h"

namespace hapticd::sim {
namespace {

using namespace std::chrono_literals;

constexpr char kRecording[] = "/recording.haptics";
constexpr char kSocket[] = "/run/hapticd.sock";
constexpr std::int32_t kUploaded = 5;
constexpr std::size_t kServerLoop = 0;  // of the network: the first that is made
constexpr double kPlace = 777;          // where the object of the uploads is at the end

class Simulation {
 public:
  Simulation(const Script& script, bool verbose);
  Outcome run();
  std::vector<std::byte> recording() { return files_.read(kRecording); }

 private:
  void finding(const std::string& text);
  void line(const std::string& text);
  void logged(const std::string& text);
  void after(Nanos delay, std::function<void()> function);
  void perform(const Action& action);
  void move(Dice& dice);
  void pose(double y);
  void upload(Dice& dice);
  void appear(Dice& dice);
  void vanish(Dice& dice);
  void stream(Dice& dice);
  void endStream(Streamer& streamer, Dice& dice);
  void endForcesWithin(Nanos lasts);
  void failDisk(Dice& dice);
  void healDisk();
  void runOutOfMemory(Dice& dice);
  void pauseReader(Dice& dice);
  void resumeReader();
  void runOutOfDescriptors(Dice& dice);
  void visitWithoutDescriptors(Dice& dice);
  void returnDescriptors();
  bool shortOfDescriptors();
  void checkGreeted(Nanos back, Nanos stalled);
  void nonsense(Dice& dice);
  void visit(Dice& dice);
  void ask(const std::string& target, Visit::Manner manner, Dice& dice);
  void onAnswer(const std::string& target, Nanos asked, const Visit::Answer& answer, std::uint64_t seed);
  void checkVisits();
  void beat();
  void describe(bool last);
  void compare(const scene::SceneDescription& description, bool last);
  void checkEnd();
  void checkRecording();
  void checkReplay();
  std::optional<Nanos> freeFrom();
  Nanos serverStalled();
  Nanos sceneTime();
  std::optional<Judge::Top> top();
  SimClient* clientAt(const net::Endpoint& endpoint);

  const Script& script_;
  const bool verbose_;
  Outcome outcome_;
  Hash hash_;
  SimClock clock_{base::FakeWorld::kWallAtZero};
  base::SeededRandom random_;
  base::FakeFiles files_;
  Scheduler scheduler_;
  base::ScopedWorld world_;
  net::ScopedNetwork network_;
  ScopedLog log_;
  Judge judge_;
  Bench bench_;
  ScopedBench scopedBench_;
  Dice networkDice_;
  std::optional<server::Server> server_;
  std::optional<net::Loop> loop_;
  std::optional<Clients> clients_;
  std::deque<net::Subscription> timers_;

  std::unique_ptr<CubeOwner> cubeOwner_;
  std::vector<std::unique_ptr<Listener>> operators_;
  std::vector<std::unique_ptr<Batcher>> batchers_;
  std::unique_ptr<Listener> uploader_;
  std::unique_ptr<Listener> reader_;  // that sometimes does not read
  std::unique_ptr<Listener> page_;    // as a browser
  std::unique_ptr<Listener> stock_;   // with datagrams
  std::vector<std::unique_ptr<Pusher>> pushers_;
  std::vector<std::unique_ptr<Streamer>> streamers_;
  std::vector<std::unique_ptr<SimClient>> strangers_;
  std::vector<std::unique_ptr<Listener>> newcomers_;  // while descriptors are short
  std::vector<std::unique_ptr<Visit>> visits_;
  Nanos stateKnownAt_ = 0;                                 // when the newest state of the web port came
  std::uint64_t stateTick_ = 0;                            // its tick
  Nanos logSecond_ = 0;                                    // when the present second of the log began
  std::size_t logBytes_ = 0;                               // in it
  std::deque<std::pair<Nanos, std::uint64_t>> revisions_;  // of the scene in the servo: when known
  std::map<std::uint16_t, SimClient*> byPort_;

  struct Moved {
    Nanos sent;  // of the time in which the server does not stand still
    double y;    // world units
  };
  std::deque<Moved> poses_;  // of the cube
  double y_ = 0;
  std::uint64_t moving_ = 0;  // number of the newest stream of poses
  Nanos endOfForces_ = 0;     // of clients that are gone
  Nanos stalledThen_ = 0;
  std::deque<std::pair<Nanos, std::uint32_t>> buttons_{{0, 0}};  // of the device: since when
  bool over_ = false;
  bool writesFailed_ = false;
  bool memoryFailed_ = false;
  Nanos memoryShortUntil_ = 0;                 // and what that delayed is made up for
  std::map<std::int32_t, std::int64_t> seen_;  // newest batch of each batcher that a description showed
  ListenerJudge listeners_;
  bool noDescriptors_ = false;
  std::optional<Nanos> descriptorsBack_;  // when they were back last
  bool wakesReader_ = false;              // with the next object that is touched
  int unanswered_ = 0;                    // requests for a description of the scene
  bool compared_ = false;
  bool uploaded_ = false;
  bool wallSteps_ = false;
};

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

Outcome Simulation::run() {
  files_.createFolder("/boxes");
  files_.create("/tokens", base::Existing::refuse)->write("owner " + std::string(Clients::kToken) + "\n");
  server::ServerConfig config;
  config.listenAddress = "127.0.0.1";
  config.port = 3883;
  config.http = script_.web ? "127.0.0.1:8080" : server::kHttpOff;
  config.allowNoRealtime = true;
  config.tokens = "/tokens";
  config.socket = script_.local ? kSocket : server::kSocketOff;
  scheduler_.localUser = geteuid();  // who runs the server
  if (script_.record) config.record = kRecording;
  server::DeviceConfig& device = config.devices.front();
  device.enableForces = true;
  device.blackBoxDir = "/boxes";
  device.blackBoxKeep = 3;

  server_.emplace(config);
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

  const net::Subscription beats = loop_->every(100ms, [this] { beat(); });
  for (const Action& action : script_.actions) {
    after(action.at, [this, &action] { perform(action); });
  }
  // The end: nothing more goes wrong, the operators re-arm, and everything that was sent is applied.
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
  over_ = true;
  return outcome_;
}

void Simulation::perform(const Action& action) {
  Dice dice(action.seed);
  // The uploader may stop, too, behind what it uploads.
  const auto anOperator = [&](bool orAnother) -> Listener* {
    std::vector<Listener*> candidates;
    for (const auto& op : operators_) candidates.push_back(op.get());
    for (Listener* const other : {uploader_.get(), page_.get(), stock_.get()}) {
      if (orAnother && other != nullptr) candidates.push_back(other);
    }
    Listener* const chosen = candidates[dice.below(candidates.size())];
    return chosen->connected() ? chosen : nullptr;
  };
  switch (action.kind) {
    case Action::Kind::stop:
      if (Listener* const op = anOperator(true)) op->stopForces();
      break;
    case Action::Kind::rearm:
      // Without need a re-arm only begins a ramp.
      if (Listener* const op = anOperator(false)) {
        if (op->guard.stopped != 0 || op->guard.latched != 0 || dice.chance(0.3)) op->rearmForces();
      }
      break;
    case Action::Kind::move:
      move(dice);
      break;
    case Action::Kind::batch: {
      Batcher& batcher = *batchers_[dice.below(batchers_.size())];
      if (!batcher.connected()) break;
      if (dice.chance(0.5)) batcher.moveShared();
      batcher.begin();
      after(dice.chance(0.5) ? 0 : dice.between(0, 300 * kMs), [&batcher] { batcher.commit(); });
      break;
    }
    case Action::Kind::upload:
      upload(dice);
      break;
    case Action::Kind::appear:
      appear(dice);
      break;
    case Action::Kind::vanish:
      vanish(dice);
      break;
    case Action::Kind::pauseRead:
      pauseReader(dice);
      break;
    case Action::Kind::nonsense:
      nonsense(dice);
      break;
    case Action::Kind::flood:
      if (!reader_->connected()) break;
      for (std::uint64_t i = dice.below(3000); i > 0; --i) reader_->queue(wire::Ping{});
      reader_->flush();
      break;
    case Action::Kind::wallStep:
      // Within its longest travel the server cannot tell an order that was overtaken from a clock that was
      // set.
      clock_.stepWall((dice.chance(0.5) ? 1 : -1) * dice.between(11'000 * kMs, 3'600'000 * kMs));
      wallSteps_ = true;
      break;
    case Action::Kind::diskFails:
      failDisk(dice);
      break;
    case Action::Kind::describe:
      describe(false);
      break;
    case Action::Kind::stream:
      stream(dice);
      break;
    case Action::Kind::visit:
      visit(dice);
      break;
    case Action::Kind::noMemory:
      runOutOfMemory(dice);
      break;
    case Action::Kind::noDescriptors:
      runOutOfDescriptors(dice);
      break;
  }
}

// Some read again soon after the hand touched something: the change was a report among those that were
// dropped, and those after it do not repeat it at once.
void Simulation::pauseReader(Dice& dice) {
  constexpr Nanos kPerByte = 5'000;  // of the reports that fill the window
  if (!reader_->open() || bench_.quiet) return;
  reader_->pauseReading();
  after(dice.between(100 * kMs, 4'000 * kMs), [this] { resumeReader(); });
  if (dice.chance(0.5)) after(static_cast<Nanos>(script_.window) * kPerByte, [this] { wakesReader_ = true; });
}

void Simulation::resumeReader() {
  wakesReader_ = false;
  if (reader_->open() && clock_.time() < script_.length - 1'000 * kMs) reader_->resumeReading();
}

// A stream of poses begins with a step, as when a hand tracker finds its object again.
void Simulation::move(Dice& dice) {
  if (!cubeOwner_->connected() || !cubeOwner_->uploaded) return;
  const std::uint64_t number = ++moving_;
  const double goal = dice.uniform(-2.0, 10.0);
  const auto poses = static_cast<int>(1 + dice.below(dice.chance(0.5) ? 10 : 90));
  const Nanos period = dice.between(8 * kMs, 34 * kMs);
  const double frequency = dice.uniform(0.5, 3.0);
  const double amplitude = dice.uniform(0.0, 3.0);
  for (int i = 0; i < poses; ++i) {
    const double y = goal + amplitude * std::sin(6.28 * frequency * base::toSeconds(period) * i);
    after(i * period, [this, number, y] {
      if (number == moving_ && cubeOwner_->connected()) pose(y);
    });
  }
}

void Simulation::pose(double y) {
  if (!cubeOwner_->connected()) return;
  y_ = y;
  poses_.push_back({sceneTime(), y});
  cubeOwner_->send(wire::SetTransformMatrix{0, shifted(0, y, 0)});
}

std::optional<Judge::Top> Simulation::top() {
  constexpr Nanos kApplied = 300 * kMs;
  if (!cubeOwner_ || !cubeOwner_->uploaded || memoryFailed_) return std::nullopt;  // a pose may have failed
  // Re-arms that were sent before a stop are ignored.
  const wire::GuardState& guard = operators_.front()->guard;
  if (guard.stopped != 0 || guard.latched != 0) return std::nullopt;
  const Nanos since = sceneTime() - kApplied;
  if (*cubeOwner_->uploaded > since) return std::nullopt;
  // The newest pose before the time still counts; before all poses the cube is at 0.
  while (poses_.size() > 1 && poses_[1].sent < since) poses_.pop_front();
  double lowest = poses_.empty() || poses_.front().sent >= since ? 0 : poses_.front().y;
  double highest = lowest;
  for (const Moved& pose : poses_) {
    lowest = std::min(lowest, pose.y);
    highest = std::max(highest, pose.y);
  }
  return Judge::Top{1e-3 * (kHalf + lowest), 1e-3 * (kHalf + highest), 1e-3 * kHalf};
}

// Grows while the server can carry out commands.
Nanos Simulation::sceneTime() {
  return clock_.time() - scheduler_.netStalled() - scheduler_.sceneStalled();
}

void Simulation::upload(Dice& dice) {
  if (!uploader_->connected()) return;
  constexpr std::size_t kVertices = 5000;
  const std::size_t messages = dice.chance(0.2) ? 150 + dice.below(150) : 1 + dice.below(20);
  // At the end the slowest network has carried it all.
  const std::uint64_t bytes = uploader_->unread() + messages * kVertices * sizeof(Vec3f);
  const Nanos roundTrip = 2 * (script_.networkDelay + script_.networkJitter);
  const Nanos travel = static_cast<Nanos>(bytes / script_.window + 1) * roundTrip;
  if (clock_.time() + travel > script_.length) return;
  for (std::size_t i = 0; i < messages; ++i) {
    wire::MeshVertices vertices;
    vertices.object = kUploaded;
    vertices.first = static_cast<std::int32_t>(i % 20 * kVertices);
    vertices.positions.values.assign(3 * kVertices, 1000.0F + static_cast<float>(i));
    uploader_->queue(vertices);
  }
  uploader_->flush();
  uploaded_ = true;
  // Its stop does not wait for what it sent before.
  if (!dice.chance(messages < 150 ? 0.2 : 0.8)) return;
  after(dice.between(0, 300 * kMs), [this] {
    if (uploader_->connected() && !bench_.quiet) uploader_->stopForces();
  });
}

void Simulation::appear(Dice& dice) {
  constexpr std::size_t kMost = 4;
  std::size_t present = 0;
  for (const auto& pusher : pushers_) present += pusher->open() ? 1 : 0;
  if (present >= kMost) return;
  auto pusher = std::make_unique<Pusher>(*clients_, "pusher " + std::to_string(pushers_.size()));
  pusher->effect = static_cast<std::int32_t>(pushers_.size());
  pusher->seed = dice.below(~std::uint64_t{0});
  pusher->connect();
  byPort_[pusher->local().port] = pusher.get();
  pushers_.push_back(std::move(pusher));
}

// Its forces end 250 ms after the server can know.
void Simulation::vanish(Dice& dice) {
  std::vector<Pusher*> present;
  for (const auto& pusher : pushers_) {
    if (pusher->open() && !pusher->gone) present.push_back(pusher.get());
  }
  if (present.empty()) return;
  Pusher& pusher = *present[dice.below(present.size())];
  constexpr Nanos kRamp = 250 * kMs;
  constexpr Nanos kMargin = 60 * kMs;  // the servo begins the ramp when the scene thread has not for 50 ms
  const Nanos travel = 3 * script_.networkDelay + 2 * script_.networkJitter + kMargin;
  Nanos lasts = travel + kRamp;
  // Every pause of the server begins the watch of a heartbeat anew: without one, the time is known.
  const bool pauses = script_.adversity.netStall > 0 || script_.adversity.freeze > 0 ||
                      script_.adversity.preempt > 0 || script_.faults.hang > 0;
  pusher.expectEnd();
  switch (dice.below(pauses || !pusher.watched ? 2 : 3)) {
    case 0:
      pusher.reset();
      break;
    case 2:
      pusher.beats = false;  // the program hangs
      pusher.gone = true;
      lasts += 600 * kMs;
      break;
    default:
      scheduler_.cut(pusher.local());
      pusher.reset();
      lasts += 1'600 * kMs;  // what is not acknowledged for 500 ms, or a probe after a second of silence
      break;
  }
  endForcesWithin(lasts);
}

void Simulation::endForcesWithin(Nanos lasts) {
  const Nanos stalled = serverStalled();
  endOfForces_ =
      std::max(endOfForces_ + stalled - std::exchange(stalledThen_, stalled), clock_.time() + lasts);
}

void Simulation::failDisk(Dice& dice) {
  switch (dice.below(5)) {
    case 0:
      files_.failures.sync = EIO;
      break;
    case 1:
      files_.failures.open = EMFILE;
      break;
    case 2:
      files_.failures.write = EIO;
      writesFailed_ = true;
      break;
    default:
      files_.freeBytes = dice.below(200'000);
      writesFailed_ = true;
      break;
  }
  after(dice.between(100 * kMs, 3'000 * kMs), [this] { healDisk(); });
}

void Simulation::healDisk() {
  files_.failures = {};
  files_.freeBytes.reset();
}

// Small allocations come from memory that the process has.
void Simulation::runOutOfMemory(Dice& dice) {
  scheduler_.limitMemory(std::size_t{4096} << dice.below(10));
  memoryFailed_ = true;
  ++bench_.injected;
  const Nanos length = dice.between(10 * kMs, 3'000 * kMs);
  memoryShortUntil_ = std::max(memoryShortUntil_, clock_.time() + length + 5'000 * kMs);
  after(length, [this] { scheduler_.limitMemory(0); });
}

// The sockets that the server has stay.
void Simulation::runOutOfDescriptors(Dice& dice) {
  constexpr Nanos kApart = 4'000 * kMs;  // so that those who came are connected in between
  if (noDescriptors_ || (descriptorsBack_ && clock_.time() - *descriptorsBack_ < kApart)) return;
  noDescriptors_ = true;
  ++bench_.injected;
  const std::size_t left = dice.below(3);
  scheduler_.limitSockets(kServerLoop, scheduler_.sockets(kServerLoop) + left);
  if (left == 0) files_.failures.open = EMFILE;
  const Nanos length = dice.between(10 * kMs, 3'000 * kMs);
  for (std::uint64_t i = 1 + dice.below(4); i > 0; --i) {
    after(dice.between(0, length), [this, seed = dice.below(~std::uint64_t{0})] {
      Dice visitor(seed);
      visitWithoutDescriptors(visitor);
    });
  }
  // As before, also for those who are connected.
  after(dice.between(0, length), [this] {
    if (operators_.front()->connected() && !bench_.quiet) operators_.front()->stopForces();
  });
  after(length, [this] { returnDescriptors(); });
}

void Simulation::visitWithoutDescriptors(Dice& dice) {
  if (bench_.quiet) return;
  newcomers_.push_back(
      std::make_unique<Listener>(*clients_, "newcomer " + std::to_string(newcomers_.size())));
  Listener* const newcomer = newcomers_.back().get();
  newcomer->kinds = wire::kReportButton;
  std::vector<SimClient::Way> ways{SimClient::Way::tcp};
  if (script_.web) ways.push_back(SimClient::Way::web);
  if (script_.datagrams) ways.push_back(SimClient::Way::datagrams);
  if (script_.local) ways.push_back(SimClient::Way::local);
  newcomer->way = ways[dice.below(ways.size())];
  newcomer->askPeriod = 200 * kMs;  // all of its requests will not be lost
  newcomer->connect();
  byPort_[newcomer->local().port] = newcomer;
  if (!dice.chance(0.2)) return;  // those that stay leave later
  after(dice.between(0, 500 * kMs), [newcomer] { newcomer->reset(); });
}

void Simulation::returnDescriptors() {
  if (!std::exchange(noDescriptors_, false)) return;
  scheduler_.limitSockets(kServerLoop, std::nullopt);
  if (files_.failures.open == EMFILE) files_.failures.open = 0;
  const Nanos back = clock_.time();
  descriptorsBack_ = back;
  listeners_.onDescriptorsBack();
  checkGreeted(back, scheduler_.netStalled());
}

bool Simulation::shortOfDescriptors() {
  return noDescriptors_ || (descriptorsBack_ && clock_.time() - *descriptorsBack_ < 500 * kMs);
}

// Whoever came before is greeted soon after descriptors are back; one with datagrams after its next request.
void Simulation::checkGreeted(Nanos back, Nanos stalled) {
  constexpr Nanos kDatagrams = 3'000 * kMs;
  if (noDescriptors_ || descriptorsBack_ != back) return;
  const Nanos soon = 300 * kMs + 10 * script_.networkDelay + 5 * script_.networkJitter;
  const Nanos passed = clock_.time() - back - (scheduler_.netStalled() - stalled);
  const auto check = [&](SimClient& client, Nanos limit) {
    if (passed >= limit && client.present() && !client.connected() && client.asked() < back)
      finding("client '" + client.name() + "' came while the server was short of descriptors, and " +
              std::to_string(passed / kMs) + " ms later the server has not greeted it");
  };
  for (const auto& client : pushers_) check(*client, soon);
  for (const auto& client : streamers_) check(*client, soon);
  for (const auto& client : newcomers_) {
    const bool datagrams = client->way == SimClient::Way::datagrams;
    check(*client, datagrams ? kDatagrams : soon);
    if (passed >= kDatagrams && client->present()) client->reset();
  }
  const Nanos next = passed < soon ? soon : kDatagrams;
  if (passed < kDatagrams) after(next - passed, [this, back, stalled] { checkGreeted(back, stalled); });
}

void Simulation::stream(Dice& dice) {
  constexpr std::ptrdiff_t kMost = 2;
  const auto streams = [](const auto& streamer) { return !streamer->over; };
  if (std::count_if(streamers_.begin(), streamers_.end(), streams) >= kMost) return;
  streamers_.push_back(std::make_unique<Streamer>(*clients_, "streamer " + std::to_string(streamers_.size()),
                                                  dice.below(~std::uint64_t{0})));
  Streamer* const streamer = streamers_.back().get();
  streamer->connect();
  byPort_[streamer->local().port] = streamer;
  const Nanos end = clock_.time() + dice.between(50 * kMs, 3'000 * kMs);
  const Nanos period = dice.between(5 * kMs, 60 * kMs);
  for (Nanos at = period; clock_.time() + at < end; at += dice.between(period / 2, 2 * period)) {
    after(at, [this, streamer] {
      if (streamer->ready && streamer->connected() && !bench_.quiet) streamer->next();
    });
  }
  const std::uint64_t seed = dice.below(~std::uint64_t{0});
  after(end - clock_.time(), [this, streamer, seed] {
    Dice ending(seed);
    endStream(*streamer, ending);
  });
}

// However it ends, what it sent lives for 100 ms at most.
void Simulation::endStream(Streamer& streamer, Dice& dice) {
  streamer.over = true;
  streamer.expectEnd();
  switch (dice.below(3)) {
    case 0:
      if (streamer.open()) streamer.reset();
      break;
    case 1:
      scheduler_.cut(streamer.local());
      if (streamer.open()) streamer.reset();
      break;
    default:
      break;  // connected and silent
  }
  constexpr Nanos kMargin = 10 * kMs;
  endForcesWithin(3 * script_.networkDelay + 2 * script_.networkJitter + Streamer::kLongestLife + kMargin);
}

std::optional<Nanos> Simulation::freeFrom() {
  if (script_.cube) return std::nullopt;
  for (const auto& streamer : streamers_) {
    if (!streamer->over) return std::nullopt;
  }
  for (const auto& pusher : pushers_) {
    if (pusher->open() && !pusher->gone) return std::nullopt;
  }
  return endOfForces_ + serverStalled() - stalledThen_;
}

// A servo that stands still begins the ramp with its next tick.
Nanos Simulation::serverStalled() {
  return scheduler_.netStalled() + judge_.stalled();
}

void Simulation::nonsense(Dice& dice) {
  auto stranger = std::make_unique<SimClient>(*clients_, "stranger");
  stranger->connect();
  stranger->expectEnd();
  std::vector<std::byte> bytes(1 + dice.below(3000));
  for (std::byte& b : bytes) b = static_cast<std::byte>(dice.below(256));
  if (dice.chance(0.3)) {  // a proper greeting first
    static constexpr char kCookie[] = "vrpn: ver. 07.34  0\0\0\0\0";
    const auto greeting = std::as_bytes(std::span(kCookie, 24));
    stranger->sendBytes(greeting);
  }
  if (!dice.chance(0.2)) stranger->sendBytes(bytes);
  SimClient* const raw = stranger.get();
  if (dice.chance(0.5)) {
    after(dice.between(0, 500 * kMs), [raw] {
      if (raw->open()) raw->reset();
    });
  }
  strangers_.push_back(std::move(stranger));
}

void Simulation::visit(Dice& dice) {
  static constexpr const char* kTargets[] = {"/api/state", "/metrics",      "/healthz", "/api/servers",
                                             "/",          "/api/messages", "/vrpn",    "/nothing"};
  checkVisits();
  const std::size_t which = dice.below(2 * std::size(kTargets));
  const auto manner =
      dice.chance(0.7) ? Visit::Manner::reads : static_cast<Visit::Manner>(dice.below(Visit::kManners));
  ask(kTargets[which < std::size(kTargets) ? which : 0], manner, dice);
}

void Simulation::ask(const std::string& target, Visit::Manner manner, Dice& dice) {
  visits_.push_back(
      std::make_unique<Visit>(*clients_, target, manner, dice.below(~std::uint64_t{0}),
                              [this, target, asked = clock_.time(), seed = dice.below(~std::uint64_t{0})](
                                  const Visit::Answer& answer) { onAnswer(target, asked, answer, seed); }));
}

void Simulation::onAnswer(const std::string& target, Nanos asked, const Visit::Answer& answer,
                          std::uint64_t seed) {
  hash_.add(answer.body);
  const bool expected = target == "/healthz"               ? answer.status == 200 || answer.status == 503
                        : target == "/vrpn"                ? answer.status == 426
                        : target == "/nothing"             ? answer.status == 404
                        : target.starts_with("/api/mesh?") ? answer.status == 200 || answer.status == 404
                                                           : answer.status == 200;
  // The mesh is still being made, or memory ran out.
  if (answer.status == 503 && (memoryFailed_ || target.starts_with("/api/mesh?"))) return;
  if (!expected || answer.body.empty())
    finding("the web port answers " + target + " with status " + std::to_string(answer.status) + " and " +
            std::to_string(answer.body.size()) + " bytes");
  if (target != "/api/state" || !expected) return;
  const auto state = nlohmann::json::parse(answer.body, nullptr, false);
  if (state.is_discarded()) return finding("the state of the web port is not JSON");
  const auto tick = state["devices"][0]["loop"]["ticks"].get<std::uint64_t>();
  if (tick > judge_.ticks() || (asked > stateKnownAt_ && tick < stateTick_))
    finding("the web port tells of tick " + std::to_string(tick) + " of " + std::to_string(judge_.ticks()) +
            " after tick " + std::to_string(stateTick_));
  if (tick > stateTick_) {
    stateTick_ = tick;
    stateKnownAt_ = clock_.time();
  }
  constexpr std::uint64_t kMostQueued = (std::uint64_t{8} << 20) + 65'536;
  for (const auto& client : state["clients"]) {
    if (client["queued_bytes"].get<std::uint64_t>() > kMostQueued)
      finding("a queue of " + client["queued_bytes"].dump() + " bytes");
  }
  // The web port does not wait long for a scene thread that is busy or finds no memory, but asks it again.
  const Nanos old = asked - 5'000 * kMs - 2 * script_.adversity.longestSceneStall - serverStalled();
  while (revisions_.size() > 1 && revisions_[1].first < old) revisions_.pop_front();
  const auto& scene = state["scenes"][0];
  if (clock_.time() >= memoryShortUntil_ && !revisions_.empty() && revisions_.front().first < old &&
      scene.contains("revision") && scene["revision"].get<std::uint64_t>() < revisions_.front().second)
    finding("the web port shows the scene of revision " + scene["revision"].dump() + ", long after " +
            std::to_string(revisions_.front().second));
  // As the viewer does, which shows all objects.
  Dice dice(seed);
  const auto& objects = state["scenes"][0]["objects"];
  if (objects.empty()) return;
  const auto& object = objects[dice.below(objects.size())];
  ask("/api/mesh?scene=0&object=" + std::to_string(object["id"].get<std::int64_t>()) +
          "&geometry=" + std::to_string(object["geometry"].get<std::uint64_t>()),
      Visit::Manner::reads, dice);
}

void Simulation::checkVisits() {
  const Nanos longest = 10'000 * kMs + 2 * script_.adversity.longestSceneStall;
  for (const auto& visit : visits_) {
    if (visit->waits() && clock_.time() - visit->asked() > longest + serverStalled())
      finding("the web port has not answered a request of " + visit->target() + " for " +
              std::to_string((clock_.time() - visit->asked()) / kMs) + " ms");
  }
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

}  // namespace

Outcome run(const Script& script, bool verbose, std::vector<std::byte>* recording) {
  Simulation simulation(script, verbose);
  Outcome outcome = simulation.run();
  if (recording != nullptr && script.record) *recording = simulation.recording();
  return outcome;
}

}  // namespace hapticd::sim
