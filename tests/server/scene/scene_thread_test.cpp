// A scene of several devices: each has a builder, and a recording describes the scene by one of them.
#include "server/scene/scene_thread.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/fake_world.h"
#include "base/world.h"
#include "record/archive.h"
#include "record/scene_event_codec.h"
#include "scene/builder.h"
#include "scene/commands.h"
#include "scene/last_commands.h"

namespace hapticd::server {
namespace {

using base::Nanos;

// Time passes with each look at it, not always as much.
class PassingTime final : public base::Clock {
 public:
  explicit PassingTime(base::SimulatedClock& clock) : clock_(clock) {}
  Nanos now() noexcept override {
    clock_.sleepUntil(clock_.now() + each * (1 + looks_++ % 5) / 3);
    return clock_.now();
  }
  void sleepUntil(Nanos deadline) noexcept override { clock_.sleepUntil(deadline); }
  Nanos wallNow() noexcept override { return clock_.wallNow(); }

  Nanos each = 0;

 private:
  base::SimulatedClock& clock_;
  int looks_ = 0;
};

class SceneOfTwoDevices : public testing::Test {
 protected:
  static constexpr Nanos kMs = 1'000'000;

  void TearDown() override { thread_->stop(); }

  void start(Nanos eachLook) {
    time_.each = eachLook;
    std::vector<SceneDevice> devices;
    for (auto& slot : slots_)
      devices.push_back({.config = {}, .slot = &slot, .published = {}, .publishing = {}});
    devices.front().name = "Left";
    devices.back().name = "Right";
    devices.back().config.servoPeriod_s *= ofTheSecond;
    SceneThread::Callbacks callbacks;
    callbacks.notices = [this](std::vector<scene::Notice>&& notices) {
      for (const scene::Notice& notice : notices) texts.push_back(notice.text);
    };
    thread_ = std::make_unique<SceneThread>(std::move(devices), std::move(callbacks));
    thread_->start();
    send(scene::SetSurfaceProperty{0, "stiffness", 1});
    runFor(0);
  }
  void send(scene::SceneCommand command) {
    SceneParcel parcel{.client = 1, .tasks = {}, .bytes = 0};
    parcel.tasks.push_back({1, std::move(command)});
    thread_->push(std::move(parcel));
  }
  void sendShape(float height, std::size_t triangles = 2) {
    std::vector<scene::Vec3f> vertices;
    for (std::size_t i = 0; i < 3 * triangles; ++i)
      vertices.emplace_back(static_cast<float>(i), i % 3 == 0 ? 1.F : 0.F, height);
    send(scene::SetVertices{0, 0, std::move(vertices)});
  }
  void runFor(Nanos duration) { threads_.runUntil(clock_.now() + duration); }

  // The commands that make the scene of each builder, with their times.
  std::vector<record::Bytes> descriptions() {
    std::vector<record::Bytes> all;
    SceneParcel parcel{.client = 0, .tasks = {}, .bytes = 0};
    parcel.tasks.push_back(
        {0, Inspect{[&](const std::vector<const scene::SceneBuilder*>& builders) {
           const Nanos now = clock_.now();
           for (const scene::SceneBuilder* builder : builders) {
             record::Bytes& bytes = all.emplace_back();
             for (const auto& commands : {builder->commands(now), builder->editsUnderWay(now)}) {
               for (const scene::ClientCommand& c : commands)
                 record::packSceneEvent(bytes, 0, c.client, c.at, &c.command);
             }
           }
         }}});
    thread_->push(std::move(parcel));
    runFor(0);
    return all;
  }
  void expectOneDescription() {
    const std::vector<record::Bytes> all = descriptions();
    ASSERT_EQ(all.size(), 2U);
    EXPECT_EQ(all[0], all[1]);
  }

  double ofTheSecond = 1;  // its servo period as a multiple of the first one's
  std::vector<std::string> texts;

 private:
  base::SimulatedClock clock_;
  PassingTime time_{clock_};
  base::FakeThreads threads_{clock_};
  base::FakeFiles files_;
  base::SeededRandom random_{1};
  base::ScopedWorld world_{base::World{time_, threads_, files_, random_}};
  std::vector<scene::SnapshotSlot> slots_{2};
  std::unique_ptr<SceneThread> thread_;
};

// A mesh becomes due while the scene is between two builders.
TEST_F(SceneOfTwoDevices, IsTheSameForBothWhileAMeshDeforms) {
  start(300'000);
  sendShape(0);
  runFor(100 * kMs);
  for (int i = 1; i < 300 && !HasFailure(); ++i) {
    sendShape(static_cast<float>(i));
    expectOneDescription();
    runFor(i % 13 * 70'000);
  }
}

// The pause until the next build follows from how long this one took.
TEST_F(SceneOfTwoDevices, PausesBetweenBuildsForBoth) {
  start(7 * kMs);
  sendShape(0);
  runFor(400 * kMs);
  for (std::size_t i = 3; i < 30 && !HasFailure(); ++i) {
    sendShape(0, i);
    expectOneDescription();
    runFor(30 * kMs);
  }
}

// The servo counts from the publication, which comes later for the second: the description has one time.
TEST_F(SceneOfTwoDevices, IsTheSameForBothWhileTimedForcesRun) {
  start(300'000);
  for (int i = 0; i < 40 && !HasFailure(); ++i) {
    send(scene::DefineEffect{"constant", i % 4, 0, 1, 300, 0, {}, scene::Vec3(1, 0, 0)});
    send(scene::StartEffect{i % 4});
    sendShape(static_cast<float>(i));
    runFor(i % 7 * 11 * kMs);
    expectOneDescription();
  }
}

// A bound of one of them is not that of the device under whose name the client is told.
TEST_F(SceneOfTwoDevices, TextsOfOneOfThemNameIt) {
  const scene::DefineEffect spring{"spring", 0, 1e9, 1, 0, 0, {}, {}};
  const scene::SetSurfaceProperty ofNoObject{7, "stiffness", 1};
  const std::string lowered = "would be unstable on this device and is lowered";
  const std::string refused = "there is no such object; call setObjectNumber or addObject first";
  const auto ends = [](const std::string& text, const std::string& end) { return text.ends_with(end); };

  ofTheSecond = 2;
  start(0);
  send(spring);
  send(ofNoObject);
  runFor(kMs);
  ASSERT_EQ(texts.size(), 3U);
  EXPECT_PRED2(ends, texts[0], lowered + " (device 'Left')");
  EXPECT_PRED2(ends, texts[1], lowered + " (device 'Right')");
  EXPECT_PRED2(ends, texts[2], refused);

  TearDown();
  texts.clear();
  ofTheSecond = 1;
  start(0);
  send(spring);
  send(ofNoObject);
  runFor(kMs);
  ASSERT_EQ(texts.size(), 2U) << "what is the same for both is said once";
  EXPECT_PRED2(ends, texts[0], lowered);
  EXPECT_PRED2(ends, texts[1], refused);
}

}  // namespace
}  // namespace hapticd::server
