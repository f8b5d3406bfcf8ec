// Re-rendering a recording gives the recorded forces bit for bit.
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <fstream>
#include <functional>
#include <map>
#include <set>
#include <sstream>
#include <thread>
#include <utility>

#include "base/clock.h"
#include "record/block_file.h"
#include "record/difference.h"
#include "record/recorded_file.h"
#include "record/recorder.h"
#include "record/rerender.h"
#include "record/scene_event_codec.h"
#include "record/tick_codec.h"

namespace hapticd::test {
namespace {

using record::RerenderChanges;

struct Compared {
  std::uint64_t ticks = 0;
  std::uint64_t skipped = 0;
  std::uint64_t same = 0;
  std::uint64_t touching = 0;
  std::uint64_t stopped = 0;
  std::set<std::uint64_t> revisions;
  double largest_N = 0;          // as written
  double largestRendered_N = 0;  // before the guard, which on a stalled machine lets little through
  std::string firstDifference;
};

std::vector<Compared> rerender(const std::filesystem::path& file, const RerenderChanges& changes = {}) {
  record::RecordingReader reader(file);
  record::Rerenderer again(reader.header(), changes);
  std::vector<Compared> devices(reader.header().devices.size());
  for (record::RecordingEvent event; reader.next(event);) {
    const realtime::TickReport* now = again.feed(event);
    if (now == nullptr) continue;
    const auto& [device, tick] = std::get<record::TickEvent>(event);
    Compared& compared = devices[device];
    if (!again.comparable(device)) {
      ++compared.skipped;
      continue;
    }
    ++compared.ticks;
    compared.touching += tick.report.rendering.touching ? 1 : 0;
    compared.stopped += tick.report.guard.stopped ? 1 : 0;
    compared.revisions.insert(tick.report.revision);
    compared.largest_N = std::max(compared.largest_N, (now->force_N - tick.report.force_N).norm());
    compared.largestRendered_N =
        std::max(compared.largestRendered_N, (now->rendering.force_N - tick.report.rendering.force_N).norm());
    if (record::sameOutcome(*now, tick.report)) {
      ++compared.same;
    } else if (compared.firstDifference.empty()) {
      std::ostringstream text;
      text << "tick " << tick.report.tick << " revision " << tick.report.revision << "/" << now->revision
           << " force " << tick.report.force_N.transpose() << " / " << now->force_N.transpose();
      compared.firstDifference = text.str();
    }
  }
  EXPECT_EQ(reader.remark(), "");
  return devices;
}

class Rerender : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    file_ = std::make_unique<RecordingFile>();
    const Hand hand = Hand::stroking();
    RunningServer server(recordingConfig(hand, file_->path()));
    played_ = playSession(server);
  }
  static void TearDownTestSuite() { file_.reset(); }
  void SetUp() override { ASSERT_TRUE(played_) << "the session did not go as scripted"; }

  static std::unique_ptr<RecordingFile> file_;
  static bool played_;
};

std::unique_ptr<RecordingFile> Rerender::file_;
bool Rerender::played_ = false;

TEST_F(Rerender, GivesTheRecordedForcesBitForBit) {
  const auto devices = rerender(file_->path());
  ASSERT_EQ(devices.size(), 2U);
  for (const Compared& device : devices) {
    EXPECT_EQ(device.same, device.ticks) << device.firstDifference;
    EXPECT_EQ(device.skipped, 0U);
    EXPECT_EQ(device.largest_N, 0);
    EXPECT_GT(device.touching, 100U);
    EXPECT_GT(device.revisions.size(), 10U);
  }
  EXPECT_GT(devices[0].stopped, 10U);
}

// Stands still, and takes every force.
class Table final : public device::Device {
 public:
  void open() override {}
  void close() noexcept override {}
  const device::DeviceProfile& profile() const noexcept override { return profile_; }
  bool read(base::Nanos /*now*/, device::DeviceState& /*state*/) noexcept override { return true; }
  bool write(const geometry::Vec3& /*force_N*/) noexcept override { return true; }

 private:
  const device::DeviceProfile profile_;
};

TEST(RerenderOfADevice, ThatEndsForcesByItselfGivesWhatTheGuardDid) {
  constexpr base::Nanos kMs = 1'000'000;
  record::RecordedDevice device{.names = {"table"}, .driver = {}, .model = {}, .sceneConfig = {}, .tick = {}};
  device.tick.guard.armed = true;
  device.tick.forceLife = 3 * kMs;
  Table table;
  base::SimulatedClock clock;
  realtime::Tick tick(table, clock, device.tick);
  realtime::RecordRing ring(1024);
  tick.recordTo({.ticks = &ring});
  for (int i = 0; i < 1000; ++i) {
    const bool pause = i == 600 || i == 990;
    clock.sleepUntil(clock.now() + (pause ? 4 * kMs : kMs));
    tick(clock.now());
  }
  record::Rerenderer again({.program = {}, .config = {}, .devices = {device}, .law = {}}, {});
  int expired = 0;
  int same = 0;
  ring.consume([&](const realtime::TickRecord& recorded) {
    record::Bytes bytes;
    record::TickPacker().add(recorded, bytes);
    record::TickEvent event;
    record::TickUnpacker(bytes).next(event.tick);
    expired += event.tick.expired ? 1 : 0;
    const realtime::TickReport* now = again.feed(event);
    same += record::sameOutcome(*now, recorded.report) ? 1 : 0;
  });
  EXPECT_EQ(expired, 2);
  EXPECT_EQ(same, 1000);
  EXPECT_LT(tick.last().guard.gain, 0.1) << "after the pause";
}

TEST_F(Rerender, IsTheSameEveryTime) {
  const RerenderChanges softer{.stiffness_N_per_m = 200};
  const auto once = rerender(file_->path(), softer);
  const auto twice = rerender(file_->path(), softer);
  for (std::size_t i = 0; i < once.size(); ++i) EXPECT_EQ(once[i].largest_N, twice[i].largest_N);
}

TEST_F(Rerender, ChangesChangeForces) {
  for (const RerenderChanges& changes :
       {RerenderChanges{.stiffness_N_per_m = 100}, RerenderChanges{.toolRadius_m = 0.004},
        RerenderChanges{.staticFriction = 0, .dynamicFriction = 0}, RerenderChanges{.raw = true}}) {
    const auto devices = rerender(file_->path(), changes);
    EXPECT_LT(devices[0].same, devices[0].ticks);
    if (!changes.raw) {
      EXPECT_GT(devices[0].largestRendered_N, 0.01);
    }
    // Free of contact nothing changes but without the guard.
    EXPECT_EQ(devices[0].same > 0, !changes.raw);
  }
}

TEST_F(Rerender, ADynamicFrictionAloneRaisesTheStaticOne) {
  const auto alone = rerender(file_->path(), RerenderChanges{.dynamicFriction = 0.8});
  const auto both = rerender(file_->path(), RerenderChanges{.staticFriction = 0.8, .dynamicFriction = 0.8});
  EXPECT_EQ(alone[0].largest_N, both[0].largest_N);
  EXPECT_GT(alone[0].largest_N, 0.01);
}

TEST_F(Rerender, AllCommandsAreInTheFile) {
  std::map<std::string, int> commands;
  std::map<scene::ClientId, base::Nanos> left;
  int gone = 0;
  int owners = 0;
  for (const record::RecordingEvent& event : eventsOf(file_->path())) {
    if (const auto* leaves = std::get_if<record::LeftEvent>(&event)) left[leaves->client] = leaves->time;
    const auto* command = std::get_if<record::SceneEvent>(&event);
    if (command == nullptr) continue;
    if (command->command) {
      ++commands[record::nameOf(*command->command)];
    } else {
      ++gone;
      const auto before = left.find(command->client);
      if (before == left.end()) continue;  // it has commanded nothing
      EXPECT_LE(before->second, command->time) << "the servo knows first";
      left.erase(before);
      ++owners;
    }
  }
  EXPECT_GE(gone, 1);
  EXPECT_GE(owners, 1);
  for (const char* name :
       {"SetVertices", "SetSurfaceProperty", "SetTransform", "DefineEffect", "StartEffect", "SetForceField",
        "BeginBatch", "CommitBatch", "AddObject", "SetSceneOrigin", "ResetScene"}) {
    EXPECT_GE(commands[name], 1) << name;
  }
}

// What the servo knows is in the file once its force has its full gain: 520 ms after a late tick.
bool untilFullGain(ScriptedPeer& peer) {
  peer.send(wire::Ping{});  // what waits to be read is no time
  if (!peer.untilNext<wire::Pong>()) return false;
  std::size_t states = 0;
  std::size_t since = peer.count<wire::IsTouching>();
  return peer.until([&] {
    const std::size_t ticks = peer.count<wire::IsTouching>();
    if (std::exchange(states, peer.count<wire::GuardState>()) != peer.count<wire::GuardState>())
      since = ticks;
    return ticks >= since + 600;
  });
}

// A client ends the recording of the start and begins another: while one hand is held in a touched cube, an
// effect vibrates and a force field pulls.
TEST_F(Rerender, RecordingBegunWhileTheServerRunsReplaysItsScene) {
  const RecordingFile first;
  const std::filesystem::path folder = std::filesystem::path(first.path()).parent_path();
  const std::string name = std::filesystem::path(first.path()).stem().string() + "-2.haptics";
  {
    const Hand hand = Hand::stroking();
    RunningServer server(recordingConfig(hand, first.path()));
    ScriptedPeer peer(server.address());
    ScriptedPeer second(server.address(), "Second");
    ASSERT_TRUE(peer.untilConnected() && second.untilConnected());
    // Outside first: what appears around a hand is not felt.
    second.send(wire::HoldHand{.hold = 1, .position = {5, 40, 5}});
    ASSERT_TRUE(untilTicks(second, 500));
    sendCube(peer);
    peer.send(wire::SetHapticProperty{0, "static friction", 0.4F});
    peer.send(wire::AddObject{7, -1});
    sendBox(peer, 7, {5, 5, 5}, {-50, 40, 0});
    ASSERT_TRUE(untilApplied(peer));
    peer.send(wire::SetSceneOrigin{{0, 0.001F, 0}, {0, 0, 1}, 0.1F});
    peer.send(wire::ForceField{.origin = {0, 0, 0}, .force = {0.3F, 0.2F, 0}, .jacobian = {}, .radius = 10});
    peer.send(wire::Effect{"vibrationMotor", 3, 0, 0.2, 0, 33.3, {}, {1, 0, 0}});
    peer.send(wire::StartEffect{3});
    const auto hold = [&](double height, bool touches) {
      second.send(wire::HoldHand{.hold = 1, .position = {5, height, 5}});
      return second.until([&] {
        const auto touched = second.last<wire::TouchedObject>();
        return touched && (touched->object == 0) == touches;
      });
    };
    ASSERT_TRUE(hold(18, true));
    peer.send(wire::RecordingControl{.record = 1, .name = std::string_view(name)});
    ASSERT_TRUE(peer.untilText("refused: this server records to"));
    peer.forget();
    peer.send(wire::RecordingControl{.record = 0, .name = std::string_view(name)});
    ASSERT_TRUE(peer.untilText("refused: this server records to"));
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("refused: nothing is recorded"));
    for (const char* elsewhere : {"../x.haptics", ".haptics", "x.csv"}) {
      peer.forget();
      peer.send(wire::RecordingControl{.record = 1, .name = elsewhere});
      ASSERT_TRUE(peer.untilText("the name of a recording has")) << elsewhere;
    }
    peer.send(wire::RecordingControl{.record = 1, .name = std::string_view(name)});
    ASSERT_TRUE(peer.untilText("recording to"));
    peer.forget();
    ASSERT_TRUE(untilTicks(second, 100));
    ASSERT_TRUE(hold(40, false));
    ASSERT_TRUE(untilFullGain(second));
    ASSERT_TRUE(hold(18, true));
    animate(peer, 40);
    second.send(wire::HoldHand{.hold = 0, .position = {}});
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
  }
  const auto devices = rerender(folder / name);
  std::filesystem::remove(folder / name);
  ASSERT_EQ(devices.size(), 2U);
  for (const Compared& device : devices) {
    EXPECT_EQ(device.same, device.ticks) << device.firstDifference;
    EXPECT_GT(device.ticks, 0U);
  }
  EXPECT_GT(devices[1].skipped, 0U) << "until the hand was free";
  EXPECT_GT(devices[1].touching, 100U);
  EXPECT_EQ(devices[1].largest_N, 0);
}

// Corner by corner, until the recording begins, and for a while after that. The hand is within, leaves the
// cube and comes back from above.
TEST_F(Rerender, RecordingBegunDuringAnUploadShowsTheMeshWhenItWasShown) {
  const RecordingFile first;
  const std::filesystem::path folder = std::filesystem::path(first.path()).parent_path();
  const std::string name = std::filesystem::path(first.path()).stem().string() + "-2.haptics";
  {
    const Hand hand = Hand::stroking();
    RunningServer server(recordingConfig(hand, first.path()));
    ScriptedPeer peer(server.address());
    ScriptedPeer second(server.address(), "Second");
    ASSERT_TRUE(peer.untilConnected() && second.untilConnected());
    second.send(wire::HoldHand{.hold = 1, .position = {5, 5, 5}});
    peer.send(wire::SetHapticProperty{0, "stiffness", 0.5F});
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
    ASSERT_TRUE(untilFullGain(second));
    peer.send(wire::RecordingControl{.record = 1, .name = std::string_view(name)});
    const std::vector<geometry::Vec3f> corners = boxTriples({20, 20, 20});
    const auto begun = [](const wire::Text& text) {
      return text.text.text.find("recording to") != std::string::npos;
    };
    for (int sent = 0, after = 0; after < 20 && sent < 20'000; ++sent) {
      const auto number = static_cast<std::size_t>(sent) % corners.size();
      geometry::Vec3f corner = corners[number];
      corner.x() += 0.01F * static_cast<float>(sent);
      peer.send(wire::SetVertex{0, static_cast<std::int32_t>(number), {corner.x(), corner.y(), corner.z()}});
      ASSERT_TRUE(untilTicks(peer, 1));
      after += std::any_of(peer.texts().begin(), peer.texts().end(), begun) ? 1 : 0;
    }
    sendCube(peer);
    second.send(wire::HoldHand{.hold = 1, .position = {5, 40, 5}});
    ASSERT_TRUE(untilFullGain(second));
    ASSERT_TRUE(pressFromAbove(second) && catchUp(second) && untilTicks(second, 100));
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
  }
  const auto devices = rerender(folder / name);
  std::filesystem::remove(folder / name);
  ASSERT_EQ(devices.size(), 2U);
  for (const Compared& device : devices) EXPECT_EQ(device.same, device.ticks) << device.firstDifference;
  EXPECT_GT(devices[1].touching, 40U);
}

// The time in the name is one of these seconds.
TEST_F(Rerender, RecordingsThatBeginInOneSecondHaveNamesOfTheirOwn) {
  const RecordingFile first;
  const std::filesystem::path folder = first.path().string() + ".d";
  std::filesystem::create_directory(folder);
  const std::time_t now = std::time(nullptr);
  for (std::time_t second = now; second < now + 300; ++second) {
    std::tm local{};
    localtime_r(&second, &local);
    char name[64] = {};
    std::strftime(name, sizeof name, "session-%Y%m%d-%H%M%S.haptics", &local);
    std::ofstream(folder / name) << "kept";
  }
  std::string answer;
  {
    const Hand hand = Hand::stroking();
    RunningServer server(recordingConfig(hand, folder / "first.haptics"));
    ScriptedPeer peer(server.address());
    ASSERT_TRUE(peer.untilConnected());
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
    peer.send(wire::RecordingControl{.record = 1, .name = {}});
    EXPECT_TRUE(peer.untilText("-2.haptics"));
    peer.forget();
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
  }
  std::filesystem::remove_all(folder);
}

// Without what was streamed the same ticks give other forces: so the file has it, and it counts.
TEST_F(Rerender, StreamedContactsAndForcesAreInTheFile) {
  record::RecordingReader reader(file_->path());
  record::Rerenderer without(reader.header());
  std::size_t streamed = 0;
  std::size_t other = 0;
  double held_N = 0;
  std::uint32_t contacts = 0;
  for (record::RecordingEvent event; reader.next(event);) {
    if (const auto* stream = std::get_if<record::StreamEvent>(&event)) {
      ++streamed;
      EXPECT_EQ(stream->device, 1U);
      contacts = std::max(contacts, stream->stream.input.contacts.count);
      held_N = std::max(held_N, stream->stream.input.force.force_N.norm());
      continue;
    }
    const realtime::TickReport* now = without.feed(event);
    if (now != nullptr && !record::sameOutcome(*now, std::get<record::TickEvent>(event).tick.report)) ++other;
  }
  EXPECT_GT(streamed, 20U);
  EXPECT_EQ(contacts, 1U);
  EXPECT_NEAR(held_N, 0.2, 1e-9);
  EXPECT_GT(other, 50U);
}

// A servo with its scene, tick by tick, and a recording that begins when it has run for a while, as the
// server begins it.
class LateRecording {
 public:
  using Vec3 = geometry::Vec3;
  static constexpr base::Nanos kTick = 1'000'000;
  static constexpr std::size_t kBatch_bytes = 8192;

  LateRecording() {
    // A box from 0 to 20 mm; an object without a placement is in metres.
    send(scene::SetVertices{0, 0, boxPoints()});
    send(scene::SetTriangles{0, 0, boxTriangles(), false});
    send(scene::SetSurface{0, 0.8, 0.001, 0.4, 0.3});
  }

  void send(scene::SceneCommand command, scene::ClientId client = 1) {
    if (recorder_) recorder_->recordCommand(0, client, now_, &command);
    builder_.apply(client, std::move(command), now_, notices_);
    changed_ = true;
  }
  void leave(scene::ClientId client) {
    if (recorder_) recorder_->recordCommand(0, client, now_, nullptr);
    builder_.clientGone(client, now_);
    owners_->forget(client);
    changed_ = true;
  }
  /// The box, by its placement and by its points.
  void move(double y_m) { send(scene::SetObjectPosition{0, {0, y_m, 0}}); }
  void raise(double y_m) {
    std::vector<geometry::Vec3f> points = boxPoints();
    for (geometry::Vec3f& point : points) point.y() += static_cast<float>(y_m);
    send(scene::SetVertices{0, 0, std::move(points)});
  }
  /// Sends another box, with its floor at this height and without a batch, triangle by triangle. More than 12
  /// repeat the first ones.
  void upload(std::int32_t object, double y_m, int count, const std::function<void(int)>& beforeEach,
              const std::function<void()>& afterEach) {
    std::vector<geometry::Vec3f> points = boxPoints();
    for (geometry::Vec3f& point : points) point.y() += static_cast<float>(y_m);
    points.push_back(points.front());  // so that it is another mesh, not the same one deformed
    send(scene::SetVertices{object, 0, std::move(points)});
    const std::vector<geometry::Triangle> triangles = boxTriangles();
    for (int i = 0; i < count; ++i) {
      beforeEach(i);
      const geometry::Triangle& t = triangles[static_cast<std::size_t>(i) % triangles.size()];
      send(scene::SetTriangles{object, i, {{t[1], t[2], t[0]}}, true});  // what stays would be no edit
      afterEach();
    }
  }
  /// Until a recording begins, the scene takes so long from one reading of its stopwatch to the next.
  void slowDown(base::Nanos reading) { reading_ = reading; }
  /// The same as far as the servo knows; leave() follows when the scene is less busy.
  void leaveBusyScene(scene::ClientId client) { owners_->leave(client, now_); }
  void stream(const realtime::RemoteInput& input) { tick_.remote().write(input); }
  realtime::GuardControl& control() { return tick_.control(); }
  base::Nanos now() const { return now_; }
  const realtime::TickReport& last() const { return tick_.last(); }

  /// The hand glides to a place, ever more slowly.
  void glide(const Vec3& place_mm, int ticks) {
    const Vec3 way = hand_.position_m - 1e-3 * place_mm;
    for (int i = 1; i <= ticks; ++i) {
      const double left = std::exp(-0.02 * i);
      hand_.position_m = 1e-3 * place_mm + left * way;
      hand_.velocity_m_per_s = -20 * left * way;
      step();
    }
  }

  void record(const std::filesystem::path& file) {
    record::RecorderOptions options;
    options.ticks = 1U << 13U;
    auto recorder = std::make_unique<record::Recorder>(
        file, [](record::RecorderProblem, const std::string& text) { ADD_FAILURE() << text; }, options);
    recorder->addDevice(device_);
    recorder->start(0, "");
    stopwatch_ = recorder->stopwatch(0);
    owners_->watch([r = recorder.get()](scene::ClientId client, std::optional<base::Nanos> left) {
      r->recordLeft(0, client, left.value_or(0));
    });
    for (const scene::ClientCommand& c : builder_.commands(now_))
      recorder->recordCommand(0, c.client, c.at, &c.command);
    recorder->recordPublish(0, now_ - 200 * kTick, builder_.revision());
    for (const scene::ClientCommand& c : builder_.editsUnderWay(now_))
      recorder->recordCommand(0, c.client, c.at, &c.command);
    tick_.recordTo({.ticks = &recorder->ring(0),
                    .streams = &recorder->streamRing(0),
                    .memories = &recorder->memoryRing(0),
                    .revision = builder_.revisionWith(now_).value_or(realtime::Tick::Rings::kUnknown)});
    recorder_ = std::move(recorder);
    if (!builder_.revisionWith(now_)) unshown_ = now_;
  }
  void end() {
    tick_.recordTo({});
    owners_->watch(nullptr);
    stopwatch_ = nullptr;
    recorder_->finish();
    recorder_.reset();
  }

 private:
  class GlidingHand final : public device::Device {
   public:
    void open() override {}
    void close() noexcept override {}
    const device::DeviceProfile& profile() const noexcept override { return profile_; }
    bool read(base::Nanos now, device::DeviceState& state) noexcept override {
      state.time = now;
      state.position_m = position_m;
      state.velocity_m_per_s = velocity_m_per_s;
      return true;
    }
    bool write(const Vec3&) noexcept override { return true; }

    Vec3 position_m{0.001, 0.030, 0.002};
    Vec3 velocity_m_per_s = Vec3::Zero();

   private:
    const device::DeviceProfile profile_;
  };

  static std::vector<geometry::Vec3f> boxPoints() {
    constexpr float kHalf = 0.015F;
    constexpr float kTop = 0.020F;
    return {{-kHalf, 0, -kHalf},    {kHalf, 0, -kHalf},    {kHalf, 0, kHalf},    {-kHalf, 0, kHalf},
            {-kHalf, kTop, -kHalf}, {kHalf, kTop, -kHalf}, {kHalf, kTop, kHalf}, {-kHalf, kTop, kHalf}};
  }

  static std::vector<geometry::Triangle> boxTriangles() {
    return {{0, 1, 2}, {0, 2, 3}, {4, 6, 5}, {4, 7, 6}, {0, 5, 1}, {0, 4, 5},
            {1, 6, 2}, {1, 5, 6}, {2, 7, 3}, {2, 6, 7}, {3, 4, 0}, {3, 7, 4}};
  }

  static record::RecordedDevice describedDevice() {
    record::RecordedDevice device;
    device.names = {"Phantom"};
    device.driver = "simulated";
    device.sceneConfig.limits.batch_bytes = kBatch_bytes;
    device.tick.guard.armed = true;
    device.tick.guard.peakForce_N = 4;
    device.tick.guard.continuousForce_N = 1;
    return device;
  }

  scene::SceneConfig withStopwatch() {
    scene::SceneConfig config = device_.sceneConfig;
    config.stopwatch = [this] { return stopwatch_ ? stopwatch_() : slow_ += reading_; };
    config.owners = owners_;
    return config;
  }

  void step() {
    now_ += kTick;
    const auto due = builder_.nextDeadline();
    if (std::exchange(changed_, false) || (due && *due <= now_)) {
      const auto snapshot = builder_.publish(now_, notices_);
      if (recorder_) recorder_->recordPublish(0, now_, snapshot ? snapshot->revision : 0);
      if (const auto shown = unshown_ ? builder_.revisionWith(*unshown_) : std::nullopt) {
        tick_.rememberFrom(*shown);
        unshown_.reset();
      }
      if (snapshot) tick_.snapshots().publish(snapshot);
    }
    clock_.sleepUntil(now_);
    tick_(now_);
  }

  const record::RecordedDevice device_ = describedDevice();
  base::Nanos now_ = 1'000'000'000;
  std::function<base::Nanos()> stopwatch_;
  base::Nanos reading_ = 0;
  base::Nanos slow_ = 0;
  std::vector<scene::Notice> notices_;
  bool changed_ = false;
  std::optional<base::Nanos> unshown_;  // the begin of a recording, until all edits before it are published
  const std::shared_ptr<scene::ForceOwners> owners_ = std::make_shared<scene::ForceOwners>();
  scene::SceneBuilder builder_{withStopwatch()};
  base::SimulatedClock clock_;
  GlidingHand hand_;
  realtime::Tick tick_{hand_, clock_, device_.tick};
  std::unique_ptr<record::Recorder> recorder_;
};

// What goes on when the recording begins.
struct GoesOn {
  const char* name;
  std::function<void(LateRecording&)> begin;
  bool touching = false;  // the hand is in the box
};

void PrintTo(const GoesOn& what, std::ostream* out) {
  *out << what.name;
}

realtime::RemoteInput streamed(const LateRecording& r, std::uint64_t number) {
  realtime::RemoteInput input;
  realtime::RemoteContactSet& set = input.contacts;
  set.number = number;
  set.received = set.stated = r.now();
  set.count = 1;
  set.contacts[0].point_m = {0, 0.031, 0};
  set.contacts[0].stiffness_N_per_m = 300;
  return input;
}

const geometry::Vec3 kAbove{1, 30, 2};

const GoesOn kGoesOn[] = {
    {"nothing", [](LateRecording& r) { r.glide(kAbove, 700); }},
    // So near to its place that the proxy does not follow any more.
    {"rest", [](LateRecording& r) { r.glide(kAbove, 1400); }},
    {"contact",
     [](LateRecording& r) {
       r.glide({1, 19, 2}, 700);
     },
     true},
    {"effect",
     [](LateRecording& r) {
       r.send(scene::DefineEffect{"constant", 1, 0, 0.4, 0, 0, geometry::Vec3::Zero(), {1, 0, 0}});
       r.send(scene::StartEffect{1});
       r.glide(kAbove, 700);
     }},
    {"timedEffect",
     [](LateRecording& r) {
       r.send(scene::DefineEffect{"constant", 1, 0, 0.4, 900, 0, geometry::Vec3::Zero(), {1, 0, 0}});
       r.send(scene::StartEffect{1});
       r.glide(kAbove, 700);
     }},
    {"vibrationInContact",
     [](LateRecording& r) {
       r.send(scene::DefineEffect{"vibrationMotor", 3, 0, 0.4, 0, 33.3, geometry::Vec3::Zero(), {1, 0, 0}});
       r.send(scene::StartEffect{3});
       r.glide({1, 19, 2}, 313);
       r.send(scene::DefineEffect{"vibrationMotor", 3, 0, 0.4, 0, 47.1, geometry::Vec3::Zero(), {1, 0, 0}});
       r.glide({1, 19, 2}, 400);
     },
     true},
    {"frictionInContact",
     [](LateRecording& r) {
       r.send(scene::DefineEffect{"friction", 2, 0.3, 0.5, 0, 0, geometry::Vec3::Zero(),
                                  geometry::Vec3::Zero()});
       r.send(scene::StartEffect{2});
       r.glide({6, 19, 2}, 700);
     },
     true},
    {"buzz",
     [](LateRecording& r) {
       r.send(scene::StartCustomEffect{0, {0.5F, 33.3F, 100, 1, 0, 0}});
       r.glide(kAbove, 700);
     }},
    {"plane",
     [](LateRecording& r) {
       r.send(scene::SetPlane{0, {0, 1, 0, -0.0195}, 0.3, 0.001, 0.2, 0.1, 10});
       r.send(scene::SetPlaneDetail{0, 0, 0.0002, 0.002, 0.0005, 33.3});
       r.glide({1, 19, 2}, 300);
       r.glide(kAbove, 400);
     }},
    {"heat",
     [](LateRecording& r) {
       r.glide({1, 15, 2}, 3037);
       r.glide(kAbove, 700);
     }},
    {"ramp",
     [](LateRecording& r) {
       r.glide(kAbove, 500);
       r.control().rampIn();
       r.glide(kAbove, 1);
     }},
    {"ownerGone",
     [](LateRecording& r) {
       r.send(scene::DefineEffect{"constant", 1, 0, 0.4, 0, 0, geometry::Vec3::Zero(), {1, 0, 0}}, 2);
       r.send(scene::StartEffect{1}, 2);
       r.send(scene::SetForceField{geometry::Vec3::Zero(), {0, 0, 0.3}, {}, 1}, 2);
       r.glide(kAbove, 500);
       r.leave(2);
       r.glide(kAbove, 50);
     }},
    {"stream",
     [](LateRecording& r) {
       r.glide(kAbove, 500);
       for (std::uint64_t i = 1; i < 10; ++i) {
         r.stream(streamed(r, i));
         r.glide(kAbove, 10);
       }
     }},
};

bool knowsPast(const std::filesystem::path& file) {
  std::string remark;
  std::string law;
  return record::compare(file, {}, remark, law).front().knowsPast();
}

class RecordingBegunLate : public testing::TestWithParam<GoesOn> {};

TEST_P(RecordingBegunLate, GivesTheRecordedForcesBitForBit) {
  const RecordingFile file;
  LateRecording r;
  r.glide({1, 18, 2}, 700);
  r.glide(kAbove, 300);
  GetParam().begin(r);
  ASSERT_EQ(r.last().rendering.touching, GetParam().touching);
  r.record(file.path());
  r.glide(GetParam().touching ? geometry::Vec3{1.5, 18.9, 2} : kAbove, 100);
  r.glide({2, 30, 1}, 800);
  r.glide({-2, 16, 1}, 900);
  r.glide({3, 16.5, 1}, 300);
  r.send(scene::SetSurfaceProperty{0, "static friction", 0.1});
  r.glide({3, 24, 1}, 200);
  r.stream(streamed(r, 100));
  r.glide({3, 19.5, 3}, 300);
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
  EXPECT_EQ(compared.largest_N, 0);
  EXPECT_GT(compared.ticks, 1700U);
  EXPECT_EQ(compared.ticks + compared.skipped, 2600U);
  EXPECT_GT(compared.touching, 800U);
}

// Writes the file again, with the blocks as `change` leaves them, and without those that it refuses.
template <class Change>
void rewrite(const std::filesystem::path& file, const Change& change) {
  record::Bytes changed(record::magic().begin(), record::magic().end());
  record::BlockReader blocks(file);
  for (record::BlockReader::Block block; blocks.next(block);) {
    if (change(block)) record::appendBlock(changed, block.kind, block.content);
  }
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(changed.data()), static_cast<std::streamsize>(changed.size()));
}

// As a version wrote the file that did not know this kind of block.
void removeBlocks(const std::filesystem::path& file, record::BlockKind kind) {
  rewrite(file, [kind](const record::BlockReader::Block& block) { return block.kind != kind; });
}

// As a version wrote the file that let effects start anew.
void startEffectsAnew(const std::filesystem::path& file) {
  rewrite(file, [](record::BlockReader::Block& block) {
    record::SceneEvent event;
    std::string error;
    if (block.kind != record::BlockKind::scene || !record::unpackSceneEvent(block.content, event, error) ||
        !event.command)
      return true;
    if (const auto* goesOn = std::get_if<scene::ContinueEffect>(&*event.command)) {
      const scene::SceneCommand start = scene::StartEffect{goesOn->index};
      block.content.clear();
      record::packSceneEvent(block.content, event.scene, event.client, event.time, &start);
    }
    return true;
  });
}

scene::DefineEffect pull(std::int32_t index, double duration_ms) {
  return {"constant", index, 0, 0.4, duration_ms, 0, geometry::Vec3::Zero(), {1, 0, 0}};
}

// More ticks than these are compared, and all of them are the same.
void endTheSame(LateRecording& r, const RecordingFile& file, std::uint64_t ticks) {
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_GT(compared.ticks, ticks);
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
}

// The force ramps in until the effect has ended: so no tick that is compared felt it.
TEST(RecordingBegunLate, EndsATimedEffectWhenItEnded) {
  const RecordingFile file;
  LateRecording r;
  r.send(pull(1, 1000));
  r.send(scene::StartEffect{1});
  r.glide(kAbove, 900);
  r.control().rampIn();
  r.record(file.path());
  r.glide(kAbove, 1000);
  EXPECT_EQ(r.last().rendering.force_N.norm(), 0);
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_GT(compared.ticks, 400U);
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
  startEffectsAnew(file.path());
  EXPECT_EQ(rerender(file.path()).front().same, compared.ticks) << "of an older version";
}

// Its new definition has no duration, and nobody starts it.
TEST(RecordingBegunLate, DefinesAnEffectThatEndedWithoutStartingIt) {
  const RecordingFile file;
  LateRecording r;
  r.send(pull(1, 1000));
  r.send(scene::StartEffect{1});
  r.glide(kAbove, 800);
  r.record(file.path());
  r.glide(kAbove, 500);
  r.send(pull(1, 0));
  r.glide(kAbove, 500);
  EXPECT_EQ(r.last().rendering.force_N.norm(), 0);
  endTheSame(r, file, 900);
}

// A start waits for its definition for one second, also when the recording begins meanwhile.
TEST(RecordingBegunLate, ForgetsAStartWithoutADefinitionWhenItWasForgotten) {
  const RecordingFile file;
  LateRecording r;
  r.send(scene::StartEffect{5});
  r.glide(kAbove, 600);
  r.record(file.path());
  r.glide(kAbove, 700);
  r.send(pull(5, 0));
  r.glide(kAbove, 300);
  EXPECT_EQ(r.last().rendering.force_N.norm(), 0);
  endTheSame(r, file, 900);
}

TEST(RecordingBegunLate, LeavesABatchRefusedThatWasRefused) {
  const RecordingFile file;
  LateRecording r;
  r.send(scene::BeginBatch{}, 2);
  r.send(scene::SetVertices{1, 0, std::vector<geometry::Vec3f>(LateRecording::kBatch_bytes)}, 2);
  r.glide(kAbove, 700);
  r.record(file.path());
  r.glide(kAbove, 50);
  r.send(pull(1, 0), 2);
  r.send(scene::StartEffect{1}, 2);
  r.send(scene::CommitBatch{}, 2);
  r.send(scene::SetTouchableFaces{0});  // for a publication
  r.glide(kAbove, 100);
  EXPECT_EQ(r.last().rendering.force_N.norm(), 0);
  r.send(pull(1, 0), 2);
  r.send(scene::StartEffect{1}, 2);
  r.glide(kAbove, 100);
  EXPECT_NEAR(r.last().rendering.force_N.norm(), 0.4, 1e-9) << "after the batch";
  endTheSame(r, file, 200);
}

// How far the proxy stays off a mesh depends on the size of its shape, not of the shapes before.
TEST(RecordingBegunLate, HasAMeshThatHasDeformed) {
  const RecordingFile file;
  LateRecording r;
  r.glide({1, 60, 2}, 400);
  r.raise(0.03);
  r.glide({1, 60, 2}, 100);
  r.raise(0);
  r.glide(kAbove, 700);
  r.record(file.path());
  r.glide(kAbove, 50);
  r.glide({2, 19, 1}, 400);
  EXPECT_TRUE(r.last().rendering.touching);
  endTheSame(r, file, 400);
}

// Triangles around a vertex are joined until a vertex has moved.
TEST(RecordingBegunLate, HasAFanThatHasDeformed) {
  const RecordingFile file;
  LateRecording r;
  constexpr std::uint32_t kRim = 600;
  const auto fan = [](float height_m) {
    std::vector<geometry::Vec3f> points{{0, height_m, 0}};
    for (std::uint32_t i = 0; i < kRim; ++i) {
      const float angle = 6.2831853F * static_cast<float>(i) / kRim;
      points.emplace_back(0.01F * std::cos(angle), 0.03F, -0.01F * std::sin(angle));
    }
    return points;
  };
  std::vector<geometry::Triangle> triangles;
  for (std::uint32_t i = 0; i < kRim; ++i) triangles.push_back({0, 1 + i, 1 + (i + 1) % kRim});
  r.glide({1, 40, 2}, 400);
  r.send(scene::AddObject{1, -1});
  r.send(scene::SetVertices{1, 0, fan(0.032F)});
  r.send(scene::SetTriangles{1, 0, triangles, true});
  r.send(scene::SetSurface{1, 0.8, 0.001, 0.4, 0.3});
  r.glide({1, 40, 2}, 400);
  r.send(scene::SetVertices{1, 0, fan(0.033F)});
  r.glide({1, 40, 2}, 700);
  r.record(file.path());
  r.glide({1, 40, 2}, 50);
  r.glide({2, 30.5, 1}, 400);
  EXPECT_TRUE(r.last().rendering.touching);
  r.glide({-2, 30.5, 1}, 400);
  EXPECT_TRUE(r.last().rendering.touching);
  endTheSame(r, file, 700);
}

// New positions alone are shown 4 ms after the last, and 20 ms after the first at the latest. What they
// deform was there before.
TEST(RecordingBegunLate, ShowsNewPositionsWhenTheyWereShown) {
  for (const int at : {0, 1, 3, 7, 12, 19, 26}) {
    for (const int every_ms : {1, 3, 5}) {
      const RecordingFile file;
      LateRecording r;
      r.glide({1, 60, 2}, 700);
      for (int i = 0; i < 30; ++i) {
        r.raise(0.0001 * (30 - i));
        if (i == at) r.record(file.path());
        r.glide({1, 60, 2}, every_ms);
      }
      r.glide(kAbove, 500);
      r.glide({2, 19, 1}, 400);
      EXPECT_TRUE(r.last().rendering.touching);
      SCOPED_TRACE(testing::Message() << "every " << every_ms << " ms, begun at " << at);
      endTheSame(r, file, 400);
    }
  }
}

// Meshes that take long to build are built again after a pause.
TEST(RecordingBegunLate, PausesBetweenBuildsAsLong) {
  const RecordingFile file;
  LateRecording r;
  r.glide(kAbove, 400);
  r.slowDown(100 * LateRecording::kTick);
  r.raise(0.0001);
  r.glide(kAbove, 400);
  r.record(file.path());
  r.glide(kAbove, 450);
  r.glide({2, 19, 1}, 250);
  EXPECT_TRUE(r.last().rendering.touching);
  r.raise(0.002);
  r.glide({2, 19, 1}, 50);
  r.send(pull(1, 0));  // the scene is asked what is new, before the pause ends
  r.glide({2, 19, 1}, 50);
  EXPECT_LT(r.last().rendering.depth_m, 0.0015) << "the pause goes on";
  r.glide({2, 19, 1}, 600);
  EXPECT_GT(r.last().rendering.depth_m, 0.0025);
  endTheSame(r, file, 700);
}

struct Upload {
  const char* name;
  std::int32_t object;  // 0 has a mesh already
  int every_ms;         // so long that a part is published before the rest has come, or not
  int begin;            // of the recording: before this triangle
  int triangles = 12;
  double height_mm = 30;  // of the hand: in the box, or on the mesh that was there before
};

void PrintTo(const Upload& upload, std::ostream* out) {
  *out << upload.name;
}

const Upload kUploads[] = {
    {"first", 1, 3, 6},
    {"firstAtItsBegin", 1, 3, 0},
    {"firstAtItsEnd", 1, 3, 11},
    {"slow", 1, 19, 6},
    {"slowAfterAPart", 1, 25, 6},
    // After 250 ms all is published, however soon it came.
    {"longUntilShown", 1, 19, 6, 14},
    {"another", 0, 3, 6},
    {"anotherSlow", 0, 19, 6},
    {"anotherLongUntilShown", 0, 19, 6, 14},
    {"anotherOnTheFirst", 0, 19, 0, 14, 18},
};

class RecordingOfAnUpload : public testing::TestWithParam<Upload> {};

// A mesh around the hand does not push it out: the hand leaves to the side and comes back from above.
TEST_P(RecordingOfAnUpload, ShowsTheMeshWhenItWasShown) {
  const RecordingFile file;
  LateRecording r;
  r.send(scene::AddObject{1, -1});
  r.send(scene::SetSurface{1, 0.8, 0.001, 0.4, 0.3});
  r.glide(kAbove, 700);
  const auto begin = [&](int triangle) {
    if (triangle == GetParam().begin) r.record(file.path());
  };
  r.upload(GetParam().object, 0.021, GetParam().triangles, begin, [&] {
    r.glide({1, GetParam().height_mm, 2}, GetParam().every_ms);
  });
  r.glide({80, GetParam().height_mm, 2}, 600);
  r.glide({80, 70, 2}, 300);
  r.glide({1, 70, 2}, 400);
  r.glide({2, 38, 1}, 400);
  EXPECT_TRUE(r.last().rendering.touching);
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
  EXPECT_GT(compared.ticks, 900U);
  EXPECT_GT(compared.touching, 200U);
}

void pullAndPush(LateRecording& r, scene::ClientId client) {
  r.send(scene::DefineEffect{"constant", 1, 0, 0.4, 0, 0, geometry::Vec3::Zero(), {1, 0, 0}}, client);
  r.send(scene::StartEffect{1}, client);
  r.send(scene::SetForceField{geometry::Vec3::Zero(), {0, 0, 0.3}, {}, 1}, client);
}

// The servo ramps out the forces of a client that left, before the scene does.
TEST(RecordingOfABusyScene, HasTheTimeAtWhichAClientLeft) {
  for (const bool late : {false, true}) {
    const RecordingFile file;
    LateRecording r;
    r.glide(kAbove, 700);
    if (!late) r.record(file.path());
    pullAndPush(r, 2);
    r.glide(kAbove, 300);
    r.leaveBusyScene(2);
    r.glide(kAbove, 20);
    if (late) r.record(file.path());
    r.glide(kAbove, 150);
    r.leave(2);
    pullAndPush(r, 2);  // another client of this number would not be ramped out
    r.glide(kAbove, 400);
    r.end();
    const Compared compared = rerender(file.path()).front();
    EXPECT_GT(compared.ticks, 500U);
    EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
    EXPECT_EQ(compared.largest_N, 0);
    removeBlocks(file.path(), record::BlockKind::left);
    EXPECT_GT(rerender(file.path()).front().largest_N, 0.1) << "without it";
  }
}

// Energy that streamed forces and contacts spent before the recording is missing in it, too.
TEST(RecordingBegunLate, HasTheTanksOfStreamedForces) {
  const RecordingFile file;
  LateRecording r;
  std::uint64_t number = 0;
  const auto streamFor = [&](int rounds, const geometry::Vec3& to_mm) {
    for (int i = 0; i < rounds; ++i) {
      realtime::RemoteInput input = streamed(r, ++number);
      input.contacts.contacts[0].point_m.y() = i % 2 == 0 ? 0.031 : 0.036;
      input.force.number = number;
      input.force.received = r.now();
      input.force.lifetime = 100'000'000;
      input.force.force_N = {1.5, 0, 0};
      r.stream(input);
      r.glide(to_mm, 10);
    }
  };
  r.glide(kAbove, 500);
  streamFor(40, {60, 30, 2});
  EXPECT_LT(r.last().remote.energy_J, 0.012) << "it was spent";
  r.glide({60, 30, 2}, 350);
  r.record(file.path());
  r.glide({60, 30, 2}, 50);
  EXPECT_LT(r.last().remote.energy_J, 0.019) << "less than a new one starts with";
  streamFor(40, {120, 30, 2});
  r.glide({120, 30, 2}, 300);
  streamFor(20, {180, 30, 2});
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_GT(compared.ticks, 900U);
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
  EXPECT_EQ(compared.largest_N, 0);
  removeBlocks(file.path(), record::BlockKind::remoteMemory);
  EXPECT_GT(rerender(file.path()).front().largest_N, 0.01) << "without it";
}

struct Movement {
  const char* name;
  bool deforms;
  int every_ms;  // before the way, of at most 50 ms, is over, or after
  bool before;   // the recording begins
};

void PrintTo(const Movement& movement, std::ostream* out) {
  *out << movement.name;
}

const Movement kMovements[] = {
    {"quicklyMoved", false, 20, true},        {"slowlyMoved", false, 70, true},
    {"quicklyDeformed", true, 20, true},      {"slowlyDeformed", true, 70, true},
    {"quicklyMovedThen", false, 20, false},   {"slowlyMovedThen", false, 70, false},
    {"quicklyDeformedThen", true, 20, false}, {"slowlyDeformedThen", true, 70, false}};

class RecordingOfMovements : public testing::TestWithParam<Movement> {};

// A recording has its objects at the ends of their ways, and nothing of the intervals at which a client moved
// them, which set the duration of the next way.
TEST_P(RecordingOfMovements, GivesTheRecordedForcesOnceTheSceneHasSettled) {
  const RecordingFile file;
  LateRecording r;
  const auto move = [&](const geometry::Vec3& hand_mm) {
    for (int i = 0; i < 9; ++i) {
      const double y_m = i % 2 == 0 ? 0.004 : 0;
      GetParam().deforms ? r.raise(y_m) : r.move(y_m);
      r.glide(hand_mm, GetParam().every_ms);
    }
  };
  r.glide({1, 21, 2}, 700);
  if (GetParam().before) {
    r.glide(kAbove, 300);
    move(kAbove);
  }
  r.record(file.path());
  r.glide(kAbove, 5);
  move({1, 19, 2});
  r.glide({1, 35, 2}, 300);
  move({1, 19, 2});
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
  EXPECT_EQ(compared.largest_N, 0);
  EXPECT_GT(compared.ticks, 200U);
  EXPECT_GT(compared.touching, 80U);
}

// Older versions wrote the same without the memory of the servo.
TEST(RecordingBegunLateByAnOlderVersion, IsReadAndSaysWhatIsMissing) {
  const RecordingFile file;
  LateRecording r;
  r.send(scene::DefineEffect{"vibrationMotor", 3, 0, 0.4, 0, 33.3, geometry::Vec3::Zero(), {1, 0, 0}});
  r.send(scene::StartEffect{3});
  r.glide(kAbove, 713);
  r.record(file.path());
  r.glide(kAbove, 300);
  r.end();
  EXPECT_TRUE(knowsPast(file.path()));
  removeBlocks(file.path(), record::BlockKind::memory);
  EXPECT_FALSE(knowsPast(file.path()));
  const Compared compared = rerender(file.path()).front();
  EXPECT_EQ(compared.ticks, 299U);
  EXPECT_LT(compared.same, compared.ticks) << "the vibration began anew";
}

#ifndef HAPTICD_SANITIZED
// Address space in use, and little more.
class LittleMemory {
 public:
  LittleMemory() {
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    getrlimit(RLIMIT_AS, &before_);
    rlimit little = before_;
    little.rlim_cur = pages * static_cast<std::size_t>(getpagesize()) + (1U << 24U);
    setrlimit(RLIMIT_AS, &little);
  }
  ~LittleMemory() { setrlimit(RLIMIT_AS, &before_); }

 private:
  rlimit before_{};
};

TEST(Rerendering, WithoutMemoryForTheSceneSaysSo) {
  record::RecordingHeader header;
  header.devices.emplace_back();
  record::Rerenderer again(header);
  constexpr std::size_t kMany = 16U << 20U;  // 192 MiB
  const record::RecordingEvent event = record::SceneEvent{
      .client = 1, .command = scene::SetVertices{0, 0, std::vector<geometry::Vec3f>(kMany)}};
  std::string text;
  {
    const LittleMemory little;
    try {
      again.feed(event);
    } catch (const record::RecordingError& error) {
      text = error.what();
    }
  }
  EXPECT_EQ(text, "the recorded scene cannot be rebuilt on this machine: out of memory");
}
#endif

INSTANTIATE_TEST_SUITE_P(All, RecordingBegunLate, testing::ValuesIn(kGoesOn),
                         [](const auto& param) { return std::string(param.param.name); });
INSTANTIATE_TEST_SUITE_P(All, RecordingOfAnUpload, testing::ValuesIn(kUploads),
                         [](const auto& param) { return std::string(param.param.name); });
INSTANTIATE_TEST_SUITE_P(All, RecordingOfMovements, testing::ValuesIn(kMovements),
                         [](const auto& param) { return std::string(param.param.name); });

}  // namespace
}  // namespace hapticd::test
