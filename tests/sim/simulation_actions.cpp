// What clients and the machine do while the server runs.
#include <algorithm>
#include <array>
#include <cerrno>
#include <nlohmann/json.hpp>

#include "sim/simulation_run.h"

namespace hapticd::sim {

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
    vertices.first = static_cast<std::int32_t>(i % 4 * kVertices);
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

}  // namespace hapticd::sim
