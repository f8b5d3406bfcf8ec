// One scene host with a real scene thread; the test acts as the net thread, and a gate blocks the scene
// thread.
#include "server/scene/scene_host.h"

#include <gtest/gtest.h>

#include <condition_variable>
#include <deque>
#include <latch>
#include <mutex>

#include "base/world.h"
#include "wire/codec.h"

namespace hapticd::server {
namespace {

// Runs functions that the scene thread posts to the net thread.
class NetThread {
 public:
  void post(std::function<void()> function) {
    const std::lock_guard lock(mutex_);
    posted_.push_back(std::move(function));
    wake_.notify_one();
  }
  // Runs posted functions until the condition holds.
  void until(const std::function<bool()>& condition) {
    while (!condition()) {
      std::function<void()> next;
      {
        std::unique_lock lock(mutex_);
        wake_.wait(lock, [&] { return !posted_.empty(); });
        next = std::move(posted_.front());
        posted_.pop_front();
      }
      next();
    }
  }
  bool idle() {
    const std::lock_guard lock(mutex_);
    return posted_.empty();
  }

 private:
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> posted_;
};

class SceneHostTest : public ::testing::Test {
 protected:
  void SetUp() override {
    host_.add({.config = {}, .slot = &slot_, .published = {}, .publishing = {}});
    host_.start(
        {.notices =
             [this](auto&& notices) {
               net_.post([this, notices] {
                 for (const auto& notice : notices) texts_.push_back(notice.text);
               });
             },
         .relieved =
             [this](scene::ClientId client) { net_.post([this, client] { relieved_.push_back(client); }); },
         .applying = {},
         .wasReset = {}},
        [this](std::function<void()> function) { net_.post(std::move(function)); });
  }
  void TearDown() override {
    open();
    host_.stop();
  }

  // Blocks the scene thread until open().
  void close() {
    auto entered = std::make_shared<std::latch>(1);
    host_.describe([entered, gate = gate_](const auto&) {
      entered->count_down();
      gate->wait();
    });
    entered->wait();
  }
  void open() {
    if (!gate_->try_wait()) gate_->count_down();
  }

  template <wire::WireMessage M>
  bool give(scene::ClientId client, const M& message) {
    std::vector<std::byte> payload(wire::payloadSize(message));
    wire::encodePayload(message, payload.data());
    wire::MessageReceived received;
    received.kind = wire::kindOf<M>;
    received.payload = payload;
    return host_.take(client, received, error_);
  }
  // Flushes as many vertices as one read contains, until the client is full.
  void flood(scene::ClientId client) {
    for (std::int32_t next = 0; !host_.full(client);) {
      for (int i = 0; i < 5000; ++i)
        ASSERT_TRUE(give(client, wire::SetVertex{static_cast<std::int32_t>(client), next++, {}}));
      host_.flush(client);
    }
  }

  std::shared_ptr<std::latch> gate_ = std::make_shared<std::latch>(1);
  NetThread net_;
  scene::SnapshotSlot slot_;
  SceneHost host_{0, "", SceneOnDisconnect::keep};
  std::vector<scene::ClientId> relieved_;
  std::vector<std::string> texts_;
  std::string error_;
};

TEST_F(SceneHostTest, WhatIsReplayedIsChargedToo) {
  const scene::SceneCommand command =
      scene::SetVertices{.object = 0, .first = 0, .positions = std::vector<scene::Vec3f>(5000)};
  close();
  std::size_t played = 0;
  for (; played < 300 && !host_.behindReplay(); ++played) host_.play(1000, &command);
  EXPECT_TRUE(host_.behindReplay());
  EXPECT_NEAR(static_cast<double>(played), 8 * 1024 * 1024 / 60'000.0, 5);
  open();
  while (host_.behindReplay()) base::sleepFor(1'000'000);
}

TEST_F(SceneHostTest, OnlyTheClientThatFloodsIsFullUntilTheSceneCatchesUp) {
  close();
  flood(1);
  EXPECT_FALSE(host_.full(2));
  ASSERT_TRUE(give(2, wire::SetObjectNumber{1}));
  host_.flush(2);
  EXPECT_FALSE(host_.full(2));
  EXPECT_TRUE(relieved_.empty());
  open();
  net_.until([&] { return !relieved_.empty(); });
  EXPECT_EQ(relieved_, std::vector<scene::ClientId>{1});
  EXPECT_FALSE(host_.full(1));
}

TEST_F(SceneHostTest, AClientWithoutQueuedCommandsDoesNotWait) {
  close();
  flood(1);
  bool reached = false;
  host_.whenPublished(2, [&] { reached = true; });
  EXPECT_TRUE(reached);
}

TEST_F(SceneHostTest, AClientWaitsUntilItsOwnCommandsArePublished) {
  close();
  ASSERT_TRUE(give(1, wire::SetObjectNumber{1}));
  bool reached = false;
  host_.whenPublished(1, [&] { reached = true; });
  EXPECT_FALSE(reached);
  EXPECT_TRUE(net_.idle());
  open();
  net_.until([&] { return reached; });
}

// The builder waits for a pause between edits before it builds a mesh.
TEST_F(SceneHostTest, AMeshIsPublishedOnlyWhenTheServoHasIt) {
  ASSERT_TRUE(give(1, wire::SetObjectNumber{1}));
  ASSERT_TRUE(give(1, wire::MeshVertices{0, 0, {{0, 0, 0, 9, 0, 0, 0, 9, 0}}}));
  ASSERT_TRUE(give(1, wire::MeshTriangles{0, 0, {{0, 1, 2}}}));
  ASSERT_TRUE(give(1, wire::SetHapticProperty{0, "stiffness", 1.0F}));
  bool felt = false;
  bool reached = false;
  host_.whenPublished(1, [&] {
    reached = true;
    const scene::SceneSnapshot* snapshot = slot_.take();
    felt = snapshot != nullptr && snapshot->objects.size() == 1;
  });
  EXPECT_FALSE(reached);
  net_.until([&] { return reached; });
  EXPECT_TRUE(felt);
}

TEST_F(SceneHostTest, TheForcesOfALostClientEndBeforeItsQueuedCommandsAreApplied) {
  const wire::ForceField field{.origin = {0, 0, 0}, .force = {0, 1, 0}, .jacobian = {}, .radius = 10};
  ASSERT_TRUE(give(1, field));
  bool reached = false;
  host_.whenPublished(1, [&] { reached = true; });
  net_.until([&] { return reached; });
  const scene::SceneSnapshot* before = slot_.take();
  ASSERT_NE(before, nullptr);
  ASSERT_EQ(before->fields.size(), 1U);
  EXPECT_FALSE(before->fields[0].releasing);

  close();
  flood(1);
  host_.releaseForces(1);
  open();
  // The first snapshot after the gate opens contains the release, long before the last vertex.
  const scene::SceneSnapshot* after = before;
  net_.until([&] { return !relieved_.empty(); });
  after = slot_.take();
  ASSERT_NE(after, nullptr);
  EXPECT_TRUE(after->fields.empty() || after->fields[0].releasing);
}

TEST_F(SceneHostTest, TheServoLearnsAtOnceThatAClientIsGoneHoweverBusyTheSceneIs) {
  const wire::ForceField field{.origin = {0, 0, 0}, .force = {0, 1, 0}, .jacobian = {}, .radius = 10};
  ASSERT_TRUE(give(1, field));
  bool reached = false;
  host_.whenPublished(1, [&] { reached = true; });
  net_.until([&] { return reached; });
  const auto owner = slot_.take()->fields[0].owner;
  const base::Nanos before = base::now();
  const base::Nanos whole = scene::ForceOwner::kGrace + scene::ForceOwner::kRampOut;
  EXPECT_EQ(owner->share(-1, before + 2 * whole), 1);

  close();
  host_.clientGone(1);
  EXPECT_EQ(owner->share(-1, base::now() + whole), 0);
  EXPECT_EQ(owner->share(-1, before), 1);
}

TEST_F(SceneHostTest, AClientThatStaysExertsForceAgainAfterARelease) {
  const wire::ForceField field{.origin = {0, 0, 0}, .force = {0, 1, 0}, .jacobian = {}, .radius = 10};
  const auto felt = [&] {
    EXPECT_TRUE(give(1, field));
    bool reached = false;
    host_.whenPublished(1, [&] { reached = true; });
    net_.until([&] { return reached; });
    const scene::SceneSnapshot* now = slot_.take();
    return now->fields[0].owner->share(-1, base::now() + 1'000'000'000) > 0;
  };
  EXPECT_TRUE(felt());
  host_.releaseForces(1);
  EXPECT_FALSE(felt());
  host_.restoreForces(1);
  EXPECT_TRUE(felt());
  close();
  host_.releaseForces(1);
  host_.restoreForces(1);
  host_.releaseForces(1);  // before the scene came to the return
  open();
  EXPECT_FALSE(felt());
}

// All kinds of forces that belong to no object, whether the scene had the commands already when their client
// left, or the session held them back.
TEST_F(SceneHostTest, WhatAClientSentBeforeItLeftIsAppliedButNotFelt) {
  const auto sendForces = [&] {
    EXPECT_TRUE(
        give(1, wire::Effect{.type = "constant", .index = 0, .magnitude = 1, .direction = {0, 1, 0}}));
    EXPECT_TRUE(give(1, wire::StartEffect{0}));
    EXPECT_TRUE(give(1, wire::ForceField{.origin = {}, .force = {0, 1, 0}, .jacobian = {}, .radius = 10}));
    EXPECT_TRUE(give(1, wire::ConstraintMode{1}));
    EXPECT_TRUE(give(1, wire::ConstraintEnable{1}));
    EXPECT_TRUE(give(1, wire::Plane{.plane = {0, 1, 0, 0}, .stiffness = 1, .index = 0}));
    EXPECT_TRUE(give(1, wire::CustomEffect{.effect = 0, .parameters = {}}));
  };
  bool reached = false;
  const auto untilApplied = [&] {
    reached = false;
    host_.whenPublished(1, [&] { reached = true; });
    net_.until([&] { return reached; });
  };
  const base::Nanos later = base::now() + 1'000'000'000'000;
  const auto expectNothingFelt = [&] {
    const scene::SceneSnapshot* now = slot_.take();
    ASSERT_NE(now, nullptr);
    ASSERT_EQ(now->effects.size(), 1U);
    ASSERT_EQ(now->fields.size(), 2U) << "the field and the constraint";
    ASSERT_EQ(now->planes.size(), 1U);
    ASSERT_TRUE(now->buzz);
    EXPECT_EQ(now->effects[0].owner->share(-1, later), 0);
    for (const auto& field : now->fields) EXPECT_EQ(field.owner->share(-1, later), 0);
    EXPECT_EQ(now->planes[0].owner->share(-1, later), 0);
    EXPECT_EQ(now->buzz->owner->share(-1, later), 0);
  };
  close();
  ASSERT_TRUE(give(1, wire::SetObjectNumber{1}));
  sendForces();
  host_.flush(1);
  host_.restoreForces(1);  // heartbeats returned shortly before the end
  host_.peerGone(1);
  open();
  untilApplied();
  expectNothingFelt();
  sendForces();
  untilApplied();
  expectNothingFelt();
}

// The scene of another device, which the client has not commanded when it leaves.
TEST_F(SceneHostTest, AFirstCommandOfAClientThatIsGoneIsNotFelt) {
  host_.peerGone(1);
  ASSERT_TRUE(give(1, wire::ForceField{.origin = {}, .force = {0, 1, 0}, .jacobian = {}, .radius = 10}));
  bool reached = false;
  host_.whenPublished(1, [&] { reached = true; });
  net_.until([&] { return reached; });
  EXPECT_EQ(slot_.take()->fields[0].owner->share(-1, base::now() + 1'000'000'000), 0);
}

// Each seek resets the scene in the name of no client. The second reset must not follow what a client sent.
TEST_F(SceneHostTest, WhatIsReplayedKeepsItsOrderAcrossClients) {
  close();
  const std::vector<geometry::Vec3f> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const scene::SceneCommand reset = scene::ResetScene{};
  const scene::SceneCommand vertices = scene::SetVertices{0, 0, corners};
  const scene::SceneCommand triangle = scene::SetTriangles{0, 0, {{0, 1, 2}}, false};
  host_.play(0, &reset);
  host_.play(0, &reset);
  host_.play(7, &vertices);
  host_.play(7, &triangle);
  open();
  std::shared_ptr<const scene::SceneDescription> seen;
  const auto hasTriangles = [&] { return seen && !seen->objects.empty() && seen->objects[0].triangles; };
  while (!hasTriangles()) {
    seen = nullptr;
    host_.describe([&](const auto& description) { net_.post([&seen, description] { seen = description; }); });
    net_.until([&] { return seen != nullptr; });
  }
  ASSERT_TRUE(seen->objects[0].vertices);
  EXPECT_EQ(seen->objects[0].vertices->size(), 3U);
}

TEST_F(SceneHostTest, AMalformedMessageIsNamedAndChangesNothing) {
  wire::MessageReceived received;
  received.kind = wire::kindOf<wire::SetVertex>;
  const std::vector<std::byte> payload(3);
  received.payload = payload;
  EXPECT_FALSE(host_.take(1, received, error_));
  EXPECT_NE(error_.find("3 bytes"), std::string::npos) << error_;
}

}  // namespace
}  // namespace hapticd::server
