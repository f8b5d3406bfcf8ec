// Forces end with the client that owns them; objects belong to the scene and remain.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "child_client.h"
#include "feeling.h"
#include "hands.h"

namespace hapticd::test {
namespace {

const Vec3 kPush_N{1, 0, 0};
const Vec3 kNothing_N = Vec3::Zero();

/// A constant force; it ignores the other parameters.
wire::Effect push(std::int32_t index, const Vec3& force_N) {
  return {.type = "constant",
          .index = index,
          .gain = 0,
          .magnitude = force_N.norm(),
          .duration = 0,
          .frequency = 0,
          .position = {},
          .direction = {force_N.x(), force_N.y(), force_N.z()}};
}

void sendPlane(ScriptedPeer& peer) {
  peer.send(wire::Plane{.plane = {1, 0, 0, -0.0066667F},
                        .stiffness = 0.3F,
                        .damping = 0,
                        .dynamicFriction = 0,
                        .staticFriction = 0,
                        .index = 0,
                        .recoveryCycles = 1});
}

void sendConstraint(ScriptedPeer& peer) {
  peer.send(wire::ConstraintMode{1});
  peer.send(wire::ConstraintPoint{{0.0133333F, 0, 0}});
  peer.send(wire::ConstraintStiffness{100});
  peer.send(wire::ConstraintEnable{1});
}

/// Every kind of force that a client can own, each of about 1 N along x at the centre.
struct Belonging {
  const char* name;
  void (*send)(ScriptedPeer&);
};
void PrintTo(const Belonging& belonging, std::ostream* out) {
  *out << belonging.name;
}
constexpr Belonging kBelongings[] = {
    {"Effect",
     [](ScriptedPeer& peer) {
       peer.send(push(0, kPush_N));
       peer.send(wire::StartEffect{0});
     }},
    {"ForceField",
     [](ScriptedPeer& peer) {
       peer.send(wire::ForceField{{}, {1, 0, 0}, {}, 1});
     }},
    {"Plane", sendPlane},
    {"Constraint", sendConstraint},
    {"CustomEffect",
     [](ScriptedPeer& peer) {
       wire::CustomEffect slow;  // a vibration so slow that it is a constant force during the test
       slow.parameters.values = {1, 0.1F, 1000, 1, 0, 0};
       peer.send(slow);
     }},
};

class Ownership : public testing::Test {
 protected:
  using Client = std::unique_ptr<ScriptedPeer>;

  Client join(ScriptedPeer::Mode mode = ScriptedPeer::Mode::tcp) {
    auto client = std::make_unique<ScriptedPeer>(server_.address(), "Phantom", mode);
    EXPECT_TRUE(client->untilConnected());
    return client;
  }
  void SetUp() override { ASSERT_TRUE(watcher_.untilConnected()); }

  // Whether the watcher still sees this force after any ramp that has begun by now.
  bool stays(const Vec3& force_N) {
    watcher_.send(wire::Ping{});
    if (!watcher_.untilNext<wire::Pong>() || !untilTicks(watcher_, 400)) return false;
    // A force that ramped out stays zero; one that a late tick removed returns.
    return untilForce(watcher_, force_N, 0.25);
  }
  // Whether the watcher has seen the force decrease gradually.
  bool rampedOut() {
    const auto forces = watcher_.all<wire::Force>();
    return std::any_of(forces.begin(), forces.end(), [](const auto& m) {
      const double rest = norm(m.force);
      return rest > 0.2 && rest < 0.6;
    });
  }

  const Hand hand_ = Hand::at({0, 0, 0});
  RunningServer server_{hand_.config()};
  ScriptedPeer watcher_{server_.address()};
};

class OwnershipOf : public Ownership, public testing::WithParamInterface<Belonging> {};

TEST_P(OwnershipOf, RampsOutWithItsClient) {
  Client owner = join();
  GetParam().send(*owner);
  ASSERT_TRUE(untilForceAbove(watcher_, 0.8));
  ASSERT_TRUE(catchUp(watcher_));
  owner->close();
  EXPECT_TRUE(untilForce(watcher_, kNothing_N, 2e-3));
  EXPECT_TRUE(rampedOut());
}

TEST_P(OwnershipOf, EndsWithTheLastClientThatSetIt) {
  Client first = join();
  Client second = join();
  GetParam().send(*first);
  ASSERT_TRUE(untilForceAbove(watcher_, 0.8));
  GetParam().send(*second);
  ASSERT_TRUE(untilApplied(*second));
  ASSERT_TRUE(untilTicks(watcher_, 20));
  ASSERT_TRUE(untilForceAbove(watcher_, 0.8)) << "a vibration starts again from its phase 0";
  first->close();
  EXPECT_TRUE(stays(kPush_N));
  second->close();
  EXPECT_TRUE(untilForce(watcher_, kNothing_N, 2e-3));
}

TEST_P(OwnershipOf, StaysWhenOthersLeave) {
  Client owner = join();
  Client other = join();
  Client onlooker = join(ScriptedPeer::Mode::udp);
  GetParam().send(*owner);
  other->send(wire::SetObjectNumber{2});
  ASSERT_TRUE(untilApplied(*other));
  ASSERT_TRUE(untilForceAbove(watcher_, 0.8));
  other->close();
  onlooker->close();
  EXPECT_TRUE(stays(kPush_N));
}

INSTANTIATE_TEST_SUITE_P(Ownership, OwnershipOf, testing::ValuesIn(kBelongings),
                         [](const auto& instance) { return std::string(instance.param.name); });

TEST_F(Ownership, AnEffectEndsWithTheClientThatStartedIt) {
  Client definer = join();
  Client starter = join();
  definer->send(push(0, kPush_N));
  ASSERT_TRUE(untilApplied(*definer));
  starter->send(wire::StartEffect{0});
  ASSERT_TRUE(untilForce(watcher_, kPush_N));
  definer->close();
  EXPECT_TRUE(stays(kPush_N));
  starter->close();
  EXPECT_TRUE(untilForce(watcher_, kNothing_N, 2e-3));
}

TEST_F(Ownership, OneOfTwoEffectsEndsWithItsClient) {
  Client one = join();
  Client two = join();
  one->send(push(0, {1, 0, 0}));
  one->send(wire::StartEffect{0});
  two->send(push(1, {0, 0.7, 0}));
  two->send(wire::StartEffect{1});
  ASSERT_TRUE(untilForce(watcher_, {1, 0.7, 0}));
  one->close();
  ASSERT_TRUE(untilForce(watcher_, {0, 0.7, 0}, 2e-3));
  EXPECT_TRUE(stays({0, 0.7, 0}));
}

TEST_F(Ownership, TheLastWriterWins) {
  Client one = join();
  Client two = join();
  one->send(push(0, kPush_N));
  one->send(wire::StartEffect{0});
  ASSERT_TRUE(untilForce(watcher_, kPush_N));
  two->send(push(0, {0, 0, 0.5}));
  ASSERT_TRUE(untilForce(watcher_, {0, 0, 0.5}));
  one->send(push(0, {0, 0.5, 0}));
  EXPECT_TRUE(untilForce(watcher_, {0, 0.5, 0}));
  two->send(wire::StopEffect{0});
  EXPECT_TRUE(untilForce(watcher_, kNothing_N));
}

TEST_F(Ownership, AClientMayWatchWithoutSendingCommands) {
  for (const auto mode : {ScriptedPeer::Mode::tcp, ScriptedPeer::Mode::udp}) {
    const Client onlooker = join(mode);
    EXPECT_TRUE(onlooker->until([&] { return onlooker->count<wire::IsTouching>() >= 20; }));
    EXPECT_TRUE(onlooker->last<wire::TrackerPosQuat>().has_value());
  }
}

// Contents of the scene, touched by a stroking hand after the client that made them has disconnected.
class SceneOwnership : public testing::Test {
 protected:
  void serve(server::SceneOnDisconnect choice = server::SceneOnDisconnect::keep) {
    server::ServerConfig config = hand_.config();
    config.devices[0].sceneOnDisconnect = choice;
    server_ = std::make_unique<RunningServer>(config);
    watcher_ = std::make_unique<ScriptedPeer>(server_->address());
    ASSERT_TRUE(watcher_->untilConnected());
  }
  // A client sets objects, surface, workspace and faces, then disconnects.
  void makeAndLeave() {
    ScriptedPeer maker(server_->address());
    ASSERT_TRUE(maker.untilConnected());
    maker.send(wire::SetObjectNumber{2});
    sendCube(maker, 1);
    maker.send(wire::SetTransformMatrix{1, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 10, 0, 1}});
    maker.send(wire::SetWorkspaceBoundingBox{kIdentity, {-80, -56, -35, 80, 64, 35}});  // 4 mm up
    maker.send(wire::SetTouchableFace{0});
    ASSERT_TRUE(untilTouchedAt(maker, 1, 0.030));
    maker.close();
  }

  const Hand hand_ = Hand::stroking();
  std::unique_ptr<RunningServer> server_;
  std::unique_ptr<ScriptedPeer> watcher_;
};

TEST_F(SceneOwnership, ObjectsSurfacesWorkspaceAndFacesRemain) {
  serve();
  makeAndLeave();
  // The device's 40 mm are the world's 44.
  ASSERT_TRUE(catchUp(*watcher_));
  EXPECT_TRUE(untilTouchedAt(*watcher_, 1, 0.030));
  EXPECT_TRUE(untilHandAt(*watcher_, {0, 0.044, 0}, 2e-3));
  watcher_->send(wire::ResetScene{});
  ASSERT_TRUE(untilApplied(*watcher_));
  ASSERT_TRUE(catchUp(*watcher_));
  EXPECT_TRUE(untilUntouchedStroke(*watcher_));
}

TEST_F(SceneOwnership, AnIncompleteUploadStaysUsable) {
  serve();
  {
    ScriptedPeer maker(server_->address());
    ASSERT_TRUE(maker.untilConnected());
    maker.send(wire::SetHapticProperty{0, "stiffness", 1.0F});
    std::vector<Vec3f> half = boxTriples(Vec3f::Constant(20));
    half.resize(25);  // the top face and one vertex of the next triangle
    sendVertices(maker, 0, half);
    ASSERT_TRUE(untilTouchedAt(maker, 0, 0.020));
    maker.close();
  }
  ASSERT_TRUE(catchUp(*watcher_));
  EXPECT_TRUE(untilTouchedAt(*watcher_, 0, 0.020));
  sendBox(*watcher_, 0, {20, 25, 20});
  EXPECT_TRUE(untilTouchedAt(*watcher_, 0, 0.025));
}

TEST_F(SceneOwnership, ClearRemovesTheSceneWithTheLastClientThatCommandedIt) {
  serve(server::SceneOnDisconnect::clear);
  auto other = std::make_unique<ScriptedPeer>(server_->address());
  ASSERT_TRUE(other->untilConnected());
  other->send(wire::SetTouchableFace{2});
  ASSERT_TRUE(untilApplied(*other));
  makeAndLeave();
  ASSERT_TRUE(catchUp(*watcher_));
  EXPECT_TRUE(untilTouchedAt(*watcher_, 1, 0.030)) << "another client that commanded is still connected";
  other->close();
  EXPECT_TRUE(untilUntouchedStroke(*watcher_)) << "a client that only watches does not count";
  EXPECT_TRUE(untilHandAt(*watcher_, {0, 0.040, 0}, 2e-3)) << "the initial workspace is restored";
}

// A client killed by the system, beside one that lives on.
class Killed : public testing::Test {
 protected:
  // Starts an effect and uploads a cube, then only receives.
  static void live(const net::Endpoint& server, ScriptedPeer::Mode mode) {
    ScriptedPeer peer(server, "Phantom", mode);
    if (!peer.untilConnected()) return;
    sendCube(peer, 0);
    const bool tcp = mode == ScriptedPeer::Mode::tcp;
    peer.send(tcp ? push(0, {1, 0, 0}) : push(2, {0, 0.5, 0}));
    peer.send(wire::StartEffect{tcp ? 0 : 2});
    peer.until([] { return false; }, std::chrono::seconds(300));
  }
  void SetUp() override {
    ASSERT_TRUE(survivor_.untilConnected());
    survivor_.send(push(1, {0, 0, 0.7}));
    survivor_.send(wire::StartEffect{1});
    ASSERT_TRUE(untilForce(survivor_, {0, 0, 0.7}));
    for (ChildClient* child : {&tcp_, &udp_}) child->connectTo(server_.address());
    ASSERT_TRUE(untilForce(survivor_, {1, 0.5, 0.7}));
  }
  // Whether only the forces of the killed clients have ended.
  bool onlyTheSurvivorsIsLeft() { return untilForce(survivor_, {0, 0, 0.7}, 2e-3) && survivor_.open(); }

  ChildClient tcp_{[](const auto& server) { live(server, ScriptedPeer::Mode::tcp); }};
  ChildClient udp_{[](const auto& server) { live(server, ScriptedPeer::Mode::udp); }};
  const Hand hand_ = Hand::at({0, 0.045, 0});
  RunningServer server_{hand_.config()};
  ScriptedPeer survivor_{server_.address()};
};

TEST_F(Killed, TheForcesOfBothEnd) {
  tcp_.kill();
  udp_.kill();
  EXPECT_TRUE(onlyTheSurvivorsIsLeft());
}

TEST_F(Killed, ItsSceneRemains) {
  tcp_.kill();
  udp_.kill();
  ASSERT_TRUE(onlyTheSurvivorsIsLeft());
  // The cube still exists: raising it by 30 mm brings it under the hand, which is pushed out.
  ASSERT_TRUE(catchUp(survivor_));
  for (int step = 1; step <= 30; ++step) {
    survivor_.send(wire::SetTransformMatrix{
        0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, static_cast<double>(step), 0, 1}});
    ASSERT_TRUE(untilTicks(survivor_, 10));
  }
  EXPECT_TRUE(untilTouchedAt(survivor_, 0, 0.050));
}

// The kernel still acknowledges data, so the client is slow but not lost.
TEST_F(Killed, ASuspendedClientKeepsItsForcesUntilItDies) {
  tcp_.kill();
  udp_.suspend();
  ASSERT_TRUE(catchUp(survivor_));
  ASSERT_TRUE(untilTicks(survivor_, 1500));
  EXPECT_TRUE(untilForce(survivor_, {0, 0.5, 0.7}, 2e-3));
  udp_.kill();
  EXPECT_TRUE(onlyTheSurvivorsIsLeft());
}

}  // namespace
}  // namespace hapticd::test
