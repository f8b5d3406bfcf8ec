// Roles in the table, and payloads given to the handler of their struct.
#include "wire/dispatch.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

namespace hapticd::wire {
namespace {

// The control messages by wire name: 'c' needs control of the device, 'o' overtakes the sender's scene
// commands.
const std::map<std::string_view, std::string_view> kControl = {
    {"vrpn_Base ping_message", "o"},
    {"vrpn_Base text_message", ""},
    {"vrpn_Tracker Request_Tracker_To_Room", ""},
    {"vrpn_Tracker Request_Unit_To_Sensor", ""},
    {"vrpn_Tracker Request_Tracker_Workspace", ""},
    {"vrpn_Tracker set_update_rate", ""},
    {"vrpn_Tracker Reset_Origin", "c"},
    {"vrpn_Button Admin", "c"},
    {"vrpn_ForceDevice getNewObjectID", "c"},
    {"hapticd Query_Capabilities", ""},
    {"hapticd Subscribe", ""},
    {"hapticd Stop_Forces", "o"},
    {"hapticd Rearm_Forces", "c"},
    {"hapticd Heartbeat", "o"},
    {"hapticd Hold_Hand", "c"},
    {"hapticd Remote_Contacts", "co"},
    {"hapticd Held_Force", "co"},
    {"hapticd Identify", "o"},
    {"hapticd Release_Control", ""},
    {"hapticd Marker", ""},
    {"hapticd Replay_Control", ""},
    {"hapticd Recording_Control", "c"},
};

MessageKind kindAt(std::size_t index) {
  return MessageKind{static_cast<std::uint8_t>(index)};
}

TEST(Roles, ControlMessagesAreTheseAndNeedControlOrOvertakeAsListed) {
  std::map<std::string_view, std::string> control;
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    const MessageKind kind = kindAt(i);
    if (role(kind) != Role::control) continue;
    control[info(kind).name] = std::string(needsControl(kind) ? "c" : "") + (overtakes(kind) ? "o" : "");
  }
  EXPECT_EQ(control.size(), kControl.size());
  for (const auto& [name, traits] : kControl) EXPECT_EQ(control.at(name), traits) << name;
}

TEST(Roles, EverySceneCommandNeedsControlAndKeepsItsPlace) {
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    const MessageKind kind = kindAt(i);
    if (role(kind) != Role::scene) continue;
    EXPECT_EQ(info(kind).direction, Direction::kToServer) << info(kind).name;
    EXPECT_TRUE(needsControl(kind)) << info(kind).name;
    EXPECT_FALSE(overtakes(kind)) << info(kind).name;
  }
}

TEST(Roles, ReportsAreWhatOnlyTheServerSends) {
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    const MessageKind kind = kindAt(i);
    EXPECT_EQ(role(kind) == Role::report, info(kind).direction == Direction::kToClient) << info(kind).name;
    if (role(kind) == Role::report) {
      EXPECT_FALSE(needsControl(kind) || overtakes(kind)) << info(kind).name;
    }
  }
}

TEST(Roles, EachMessageOfTheTableHasOne) {
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    EXPECT_NE(role(kindAt(i)), Role::unknown) << info(kindAt(i)).name;
  }
}

TEST(Roles, AreUnknownForNamesThatAreNotInTheTable) {
  EXPECT_EQ(role(kUnknownKind), Role::unknown);
  EXPECT_FALSE(needsControl(kUnknownKind));
  EXPECT_FALSE(overtakes(kUnknownKind));
}

// Counts the calls by message name.
struct CountingHandler {
  std::map<std::string_view, int> calls;

  template <class M>
  void operator()(const M&) {
    ++calls[M::kInfo.name];
  }
};

TEST(Dispatch, CallsTheHandlerOfEachMessageOfItsRole) {
  CountingHandler control;
  CountingHandler scene;
  std::set<std::string_view> all;
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    const MessageKind kind = kindAt(i);
    std::vector<std::byte> payload(2000);  // as long as the longest message
    std::size_t size = 0;
    while (size < payload.size() && !decode(kind, ByteView(payload).first(size))) ++size;
    payload.resize(size);
    EXPECT_EQ(static_cast<bool>(dispatchControl(kind, payload, control)), role(kind) == Role::control);
    EXPECT_EQ(static_cast<bool>(dispatchScene(kind, payload, scene)), role(kind) == Role::scene);
    if (role(kind) != Role::report) all.insert(info(kind).name);
  }
  EXPECT_EQ(control.calls.size(), kControl.size());
  scene.calls.merge(control.calls);
  for (const auto& [name, count] : scene.calls) {
    EXPECT_EQ(count, 1) << name;
    EXPECT_TRUE(all.contains(name)) << name;
  }
  EXPECT_EQ(scene.calls.size(), all.size());
}

TEST(Dispatch, GivesTheDecodedValues) {
  std::array<std::byte, kPayloadSize<HoldHand>> payload{};
  const HoldHand sent{1, {1, 2, 3}, {0, 1, 0, 0}, 5};
  encodePayload(sent, payload.data());
  HoldHand received;
  const auto handler = [&]<class M>(const M& message) {
    if constexpr (std::same_as<M, HoldHand>) received = message;
  };
  ASSERT_TRUE(dispatchControl(kindOf<HoldHand>, payload, handler));
  EXPECT_EQ(received, sent);
}

TEST(Dispatch, RefusesMalformedPayloadsWithoutACall) {
  CountingHandler handler;
  const std::vector<std::byte> tooLong(3);
  const Result<void> control = dispatchControl(kindOf<Heartbeat>, tooLong, handler);
  ASSERT_FALSE(control);
  EXPECT_EQ(control.error(), "hapticd Heartbeat: payload of 3 bytes, expected 2");
  EXPECT_FALSE(dispatchScene(kindOf<SetVertex>, tooLong, handler));
  EXPECT_TRUE(handler.calls.empty());
}

TEST(Dispatch, RefusesKindsOfAnotherRole) {
  CountingHandler handler;
  EXPECT_EQ(dispatchControl(kindOf<StartEffect>, {}, handler).error(),
            "vrpn_ForceDevice startEffect is not a control message");
  EXPECT_EQ(dispatchScene(kindOf<StopForces>, {}, handler).error(),
            "hapticd Stop_Forces is not a scene command");
  EXPECT_EQ(dispatchScene(kUnknownKind, {}, handler).error(),
            "a message that is not in the table is not a scene command");
  EXPECT_TRUE(handler.calls.empty());
}

struct OnlyStops {
  void operator()(const StopForces&) {}
  void operator()(const Text&) {}
};
static_assert(handlesAll<Role::control, CountingHandler>(AllMessages{}));
static_assert(!handlesAll<Role::control, OnlyStops>(AllMessages{}),
              "dispatchControl must not compile with this handler");
static_assert(handlesAll<Role::control, OnlyStops>(MessageList<StopForces, SetVertex, Text>{}));

}  // namespace
}  // namespace hapticd::wire
