#include "server/scene/command_decoder.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <string_view>
#include <utility>
#include <variant>

#include "wire/codec.h"

namespace hapticd::server {
namespace {

class CommandDecoderTest : public ::testing::Test {
 protected:
  template <wire::WireMessage M>
  CommandDecoder::Outcome give(const M& message, scene::ClientId client = 1) {
    std::vector<std::byte> payload(wire::payloadSize(message));
    wire::encodePayload(message, payload.data());
    return giveRaw(wire::kindOf<M>, payload, client);
  }
  CommandDecoder::Outcome giveRaw(wire::MessageKind kind, const std::vector<std::byte>& payload,
                                  scene::ClientId client = 1) {
    wire::MessageReceived received;
    received.kind = kind;
    received.payload = payload;
    return decoder_.take(client, received, error_);
  }
  template <class Command>
  const Command& only() {
    tasks_ = decoder_.release();
    EXPECT_EQ(tasks_.size(), 1U);
    return std::get<Command>(std::get<scene::SceneCommand>(tasks_.front().what));
  }

  CommandDecoder decoder_;
  std::string error_;
  std::vector<SceneTask> tasks_;
};

TEST_F(CommandDecoderTest, NeighbouringVerticesBecomeOneRun) {
  for (int i = 0; i < 5; ++i) give(wire::SetVertex{3, i, {static_cast<float>(i), 1, 2}});
  const auto& run = only<scene::SetVertices>();
  EXPECT_EQ(run.object, 3);
  EXPECT_EQ(run.first, 0);
  ASSERT_EQ(run.positions.size(), 5U);
  EXPECT_EQ(run.positions[4], geometry::Vec3f(4, 1, 2));
}

TEST_F(CommandDecoderTest, OtherCommandsEndARunAndKeepTheOrder) {
  give(wire::SetVertex{0, 0, {}});
  give(wire::SetVertex{0, 2, {}});     // a gap
  give(wire::SetVertex{1, 3, {}});     // another object
  give(wire::SetVertex{1, 4, {}}, 2);  // another client
  give(wire::SetObjectNumber{4}, 2);
  give(wire::SetVertex{1, 5, {}}, 2);
  give(wire::SetVertex{1, -1, {}}, 2);  // negative: a separate run, which the scene refuses
  give(wire::SetVertex{1, 0, {}}, 2);
  EXPECT_EQ(decoder_.release().size(), 8U);
  EXPECT_TRUE(decoder_.empty());
}

TEST_F(CommandDecoderTest, TrianglesBecomeRunsAndKeepNegativeCornersRefusable) {
  give(wire::SetTriangle{0, 0, {0, 1, 2}, {-1, -1, -1}});
  give(wire::SetTriangle{0, 1, {2, 1, -5}, {-1, -1, -1}});
  const auto& run = only<scene::SetTriangles>();
  ASSERT_EQ(run.triangles.size(), 2U);
  EXPECT_EQ(run.triangles[0], (geometry::Triangle{0, 1, 2}));
  EXPECT_EQ(run.triangles[1][2], static_cast<std::uint32_t>(-5));
}

TEST_F(CommandDecoderTest, WrongLengthIsMalformedAndChangesNothing) {
  EXPECT_EQ(giveRaw(wire::kindOf<wire::SetVertex>, std::vector<std::byte>(19)),
            CommandDecoder::Outcome::malformed);
  EXPECT_NE(error_.find("19 bytes, expected 20"), std::string::npos) << error_;
  EXPECT_EQ(giveRaw(wire::kindOf<wire::SetObjectNumber>, std::vector<std::byte>(5)),
            CommandDecoder::Outcome::malformed);
  EXPECT_TRUE(decoder_.empty());
}

TEST_F(CommandDecoderTest, ControlMessagesAndReportsAreNotCommands) {
  EXPECT_EQ(give(wire::Ping{}), CommandDecoder::Outcome::notACommand);
  EXPECT_EQ(give(wire::TrackerRequestWorkspace{}), CommandDecoder::Outcome::notACommand);
  EXPECT_EQ(give(wire::Force{}), CommandDecoder::Outcome::notACommand);
  EXPECT_TRUE(decoder_.empty());
}

TEST_F(CommandDecoderTest, NamesEndAtTheFirstNul) {
  wire::SetHapticProperty property;
  property.property = wire::NameBuffer<20>("static friction");
  property.value = 0.5F;
  give(property);
  EXPECT_EQ(only<scene::SetSurfaceProperty>().name, "static friction");
}

TEST_F(CommandDecoderTest, StopOfTheCustomEffectIsItsOwnCommand) {
  give(wire::CustomEffect{wire::kStopCustomEffect, {}});
  only<scene::StopCustomEffect>();
  give(wire::CustomEffect{0, {{1.0F, 2.0F}}});
  EXPECT_EQ(only<scene::StartCustomEffect>().parameters.size(), 2U);
}

TEST_F(CommandDecoderTest, ExactlyTheSceneMessagesAreDecoded) {
  for (std::size_t i = 0; i < wire::kMessageKinds; ++i) {
    const wire::MessageKind kind{static_cast<std::uint8_t>(i)};
    const wire::Message message(kind);
    std::vector<std::byte> payload(wire::payloadSize(message));
    wire::encodePayload(message, payload.data());
    const bool isTheScenes = wire::role(kind) == wire::Role::scene;
    EXPECT_EQ(giveRaw(kind, payload) == CommandDecoder::Outcome::taken, isTheScenes) << wire::info(kind).name;
  }
}

// The numbers and the name in a message or a command.
struct Values {
  std::vector<double> numbers;
  std::string text;
};

// Gives every number of a message another value, and lists them.
struct NumberFiller : Values {
  template <class T>
  requires std::is_arithmetic_v<T>
  void operator()(const char*, T& value, const char* = "") {
    value = static_cast<T>(std::is_same_v<T, wire::Bool16> ? 1 : numbers.size() + 1);
    numbers.push_back(static_cast<double>(value));
  }
  template <class T, std::size_t N>
  void operator()(const char*, std::array<T, N>& list, const char* = "") {
    for (T& value : list) (*this)("", value);
  }
  template <std::size_t N>
  void operator()(const char*, wire::NameBuffer<N>& name, const char* = "") {
    name = wire::NameBuffer<N>(text = "a name");
  }
  template <class Count, class T, std::size_t Max>
  void operator()(const char*, wire::Counted<Count, T, Max>&, const char* = "") {}
};

// Lists the numbers of a command.
struct NumberLister : Values {
  template <class T>
  requires std::is_arithmetic_v<T>
  void operator()(const char*, const T& value) { numbers.push_back(static_cast<double>(value)); }
  template <class T, std::size_t N>
  void operator()(const char*, const std::array<T, N>& list) {
    for (const T& value : list) numbers.push_back(static_cast<double>(value));
  }
  void operator()(const char*, const geometry::Vec3& v) {
    numbers.insert(numbers.end(), v.data(), v.data() + 3);
  }
  void operator()(const char*, const std::string& name) { text = name; }
  template <class T>
  void operator()(const char*, const T&) {}
};

// A command, and the wire name of the message that has its members; an empty name where none has.
std::pair<std::string_view, Values> valuesOf(const scene::SceneCommand& command) {
  return std::visit(
      []<class Command>(const Command& c) -> std::pair<std::string_view, Values> {
        NumberLister lister;
        fields(c, lister);
        return {Command::kInfo.message, lister};
      },
      command);
}

TEST_F(CommandDecoderTest, CommandsWithTheMembersOfTheirMessageGetItsValuesInOrder) {
  std::set<std::string_view> withCommand;
  scene::forEachCommand([&]<class Command>() { withCommand.insert(Command::kInfo.message); });
  int compared = 0;
  wire::forEachMessage(wire::AllMessages{}, [&]<class M>() {
    if constexpr (M::kInfo.role == wire::Role::scene) {
      if (withCommand.count(M::kInfo.name) == 0) return;
      M message;
      NumberFiller expected;
      M::fields(message, expected);
      give(message);
      const auto tasks = decoder_.release();
      ASSERT_EQ(tasks.size(), 1U) << M::kInfo.name;
      const auto [name, got] = valuesOf(std::get<scene::SceneCommand>(tasks[0].what));
      EXPECT_EQ(name, M::kInfo.name);
      EXPECT_EQ(got.numbers, expected.numbers) << M::kInfo.name;
      EXPECT_EQ(got.text, expected.text) << M::kInfo.name;
      ++compared;
    }
  });
  EXPECT_GE(compared, 32);
}

TEST_F(CommandDecoderTest, APlaneKeepsEachOfItsValues) {
  give(wire::Plane{.plane = {1, 2, 3, 4},
                   .stiffness = 5,
                   .damping = 6,
                   .dynamicFriction = 7,
                   .staticFriction = 8,
                   .index = 9,
                   .recoveryCycles = 10});
  const auto& plane = only<scene::SetPlane>();
  EXPECT_EQ(plane.plane, (std::array<double, 4>{1, 2, 3, 4}));
  EXPECT_EQ(plane.stiffness, 5);
  EXPECT_EQ(plane.damping, 6);
  EXPECT_EQ(plane.dynamicFriction, 7);
  EXPECT_EQ(plane.staticFriction, 8);
  EXPECT_EQ(plane.index, 9);
  EXPECT_EQ(plane.recoveryCycles, 10);
}

TEST_F(CommandDecoderTest, BulkMeshesAreRunsInTheMeshesOwnUnit) {
  EXPECT_EQ(give(wire::MeshVertices{3, 10, {{0, 1, 2, 3, 4, 5}}}), CommandDecoder::Outcome::taken);
  EXPECT_EQ(give(wire::MeshTriangles{3, 7, {{0, 1, 2, 2, 1, -1}}}), CommandDecoder::Outcome::taken);
  const auto tasks = decoder_.release();
  ASSERT_EQ(tasks.size(), 2U);
  const auto& vertices = std::get<scene::SetVertices>(std::get<scene::SceneCommand>(tasks[0].what));
  EXPECT_EQ(vertices.object, 3);
  EXPECT_EQ(vertices.first, 10);
  ASSERT_EQ(vertices.positions.size(), 2U);
  EXPECT_EQ(vertices.positions[1], geometry::Vec3f(3, 4, 5));
  const auto& triangles = std::get<scene::SetTriangles>(std::get<scene::SceneCommand>(tasks[1].what));
  EXPECT_EQ(triangles.first, 7);
  EXPECT_FALSE(triangles.makesMetres);
  ASSERT_EQ(triangles.triangles.size(), 2U);
  EXPECT_EQ(triangles.triangles[0], (geometry::Triangle{0, 1, 2}));
  EXPECT_EQ(triangles.triangles[1][2], std::numeric_limits<std::uint32_t>::max());
}

TEST_F(CommandDecoderTest, BulkListsOfIncompleteTriplesAreMalformed) {
  EXPECT_EQ(give(wire::MeshVertices{0, 0, {{0, 1}}}), CommandDecoder::Outcome::malformed);
  EXPECT_EQ(give(wire::MeshTriangles{0, 0, {{0, 1, 2, 3}}}), CommandDecoder::Outcome::malformed);
  EXPECT_TRUE(decoder_.empty());
}

}  // namespace
}  // namespace hapticd::server
