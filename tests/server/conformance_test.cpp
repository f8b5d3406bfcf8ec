// Recorded clients against the running server, byte for byte, in both modes: each must get all its reports
// and texts. No other library is involved.
#include <gtest/gtest.h>

#include <set>

#include "feeling.h"
#include "hands.h"
#include "wire/cookie.h"
#include "wire/recording.h"

namespace hapticd::test {
namespace {

using wire::Bytes;
using Mode = ScriptedPeer::Mode;

// The recorded scene is a world of 0.4 units with two cubes of 0.1, at x = -0.08 and 0.08. Fitted to the
// simulated device, one metre of it is this many units.
constexpr double kUnits_per_m = (0.4 / 0.12 + 0.4 / 0.07) / 2;
constexpr double kReported_m = 1e-3;  // of a world unit

/// Strokes down onto the left and the right cube in turn for two minutes.
Hand strokingBothCubes() {
  Hand hand = Hand::at({0, 0.09 / kUnits_per_m, 0});
  double side = -1;
  for (double t_s = 0.1; t_s < 120; t_s += 0.4, side = -side) {
    const double x_m = side * 0.08 / kUnits_per_m;
    hand.row(t_s, {x_m, 0.09 / kUnits_per_m, 0});
    hand.row(t_s + 0.1, {x_m, 0.03 / kUnits_per_m, 0}, 0, 1);
    hand.row(t_s + 0.2, {x_m, 0.03 / kUnits_per_m, 0});
    hand.row(t_s + 0.3, {x_m, 0.09 / kUnits_per_m, 0});
  }
  return hand;
}

/// The stream of one recorded client, split into frames.
class Recording {
 public:
  explicit Recording(const std::string& file) : bytes_(wire::recorded(file)) {
    const wire::ByteView stream(bytes_);
    wire::LocalNames names;
    wire::Peer endpoint(names, {wire::UdpAddress{"127.0.0.1", 4000}, {}});
    endpoint.feed({}, stream.first(wire::kCookieBytes), [](const wire::Event&) {});
    for (std::size_t at = wire::kCookieBytes; at < stream.size();) {
      wire::FrameView frame;
      if (wire::readFrame(stream.subspan(at), frame) != wire::FrameStatus::kComplete) break;
      if (frame.header.type == wire::kUdpDescription) udpDescription_ = at;
      endpoint.feed({}, stream.subspan(at, frame.size), [&](const wire::Event& event) {
        if (const auto* message = std::get_if<wire::MessageReceived>(&event)) note(*message, at);
        const auto* type = std::get_if<wire::TypeDescribed>(&event);
        if (type != nullptr && type->kind == wire::kindOf<wire::ResetScene>) resetScene_ = type->id.value;
      });
      at += frame.size;
    }
  }

  /// Replaces the UDP port that the client requests.
  void describeUdp(std::uint16_t port) {
    wire::storeBig(bytes_.data() + udpDescription_ + 12, static_cast<std::int32_t>(port));
  }
  /// The bytes before its first startEffect, and the rest.
  wire::ByteView scene() const { return wire::ByteView(bytes_).first(firstStart_); }
  wire::ByteView rest() const { return wire::ByteView(bytes_).subspan(firstStart_); }
  /// Bytes of a resetScene, which the recording lacks, with the client's sender and type numbers.
  Bytes reset() const {
    wire::FrameEncoder frames;
    frames.addRaw({}, device_, resetScene_, Bytes(1));
    return {frames.bytes().begin(), frames.bytes().end()};
  }

 private:
  void note(const wire::MessageReceived& message, std::size_t at) {
    device_ = message.sender.value;
    if (message.kind == wire::kindOf<wire::StartEffect> && firstStart_ == 0) firstStart_ = at;
  }

  Bytes bytes_;
  std::size_t udpDescription_ = 0;
  std::size_t firstStart_ = 0;
  std::int32_t device_ = 0;
  std::int32_t resetScene_ = 0;
};

class Conformance : public testing::TestWithParam<Mode> {
 protected:
  void SetUp() override {
    if (isUdp()) {
      recording_.describeUdp(client_.udpPort());
      ASSERT_TRUE(client_.untilCalledBack());
    }
    client_.sendBytes(recording_.scene());
    ASSERT_TRUE(client_.untilConnected());
    if (isUdp()) {
      ASSERT_TRUE(client_.until([&] { return client_.udpPeer().port != 0; }));
      client_.sendDatagram(datagrams_.at(0));
    }
  }
  // Sends the rest of the stream and waits for the answers to the last pings.
  void playRest() {
    client_.sendBytes(recording_.rest());
    for (std::size_t i = 1; i < datagrams_.size(); ++i) client_.sendDatagram(datagrams_[i]);
    ASSERT_TRUE(client_.until([&] { return client_.count<wire::Pong>() >= pings(); }));
  }
  bool isUdp() const { return GetParam() == Mode::udp; }
  std::string prefix() const { return isUdp() ? "udp" : "tcp"; }
  std::size_t pings() const { return isUdp() ? 6 : 3; }

  bool untilTouched(std::int32_t object) {
    return client_.until([&] {
      const auto touched = client_.last<wire::TouchedObject>();
      const auto scp = client_.last<wire::Scp>();
      const double side = object == 0 ? -1 : 1;
      return touched && touched->object == object && scp &&
             std::abs(scp->position[0] - side * 0.08 * kReported_m) < 2e-6 &&
             std::abs(scp->position[1] - 0.05 * kReported_m) < 1e-9;
    });
  }

  const Hand hand_ = strokingBothCubes();
  RunningServer server_{hand_.config()};
  Recording recording_{prefix() + ".c2s.tcp.bin"};
  const std::vector<Bytes> datagrams_ =
      isUdp() ? wire::recordedDatagrams("udp.c2s.udp.bin") : std::vector<Bytes>{};
  ScriptedPeer client_{server_.address(), "Phantom", GetParam(), ScriptedPeer::Speech::raw};
};

TEST_P(Conformance, TheSceneIsRenderedAndReported) {
  ASSERT_TRUE(untilTouched(0));
  ASSERT_TRUE(untilTouched(1));
  EXPECT_TRUE(client_.until([&] { return client_.last<wire::TouchedObject>()->object == -1; }));
  for (const wire::MessageKind kind :
       {wire::kindOf<wire::TrackerPosQuat>, wire::kindOf<wire::TrackerVelocity>, wire::kindOf<wire::Force>,
        wire::kindOf<wire::Dop>, wire::kindOf<wire::Scp>, wire::kindOf<wire::Angle>,
        wire::kindOf<wire::IsTouching>, wire::kindOf<wire::TouchedObject>,
        wire::kindOf<wire::ButtonStates>}) {
    EXPECT_GT(client_.count(kind), 0U) << wire::info(kind).name;
  }
  for (const auto& force : client_.all<wire::Force>()) EXPECT_LE(norm(force.force), 3.3 + 1e-9);
  for (const auto& angle : client_.all<wire::Angle>()) {
    EXPECT_NEAR(angle.angle, 0, 0.1);  // the stylus is normal to both tops
  }
}

TEST_P(Conformance, EveryQueryIsAnswered) {
  playRest();
  EXPECT_TRUE(client_.until([&] { return client_.count<wire::TrackerToRoom>() == 1; }));
  EXPECT_TRUE(client_.until([&] { return client_.count<wire::TrackerUnitToSensor>() == 1; }))
      << "one for each sensor, and there is one";
  EXPECT_TRUE(client_.until([&] { return client_.count<wire::TrackerWorkspace>() == 1; }));
  EXPECT_TRUE(client_.until([&] { return client_.count<wire::ButtonStates>() >= pings() + 1; }))
      << "one on connection, and one for each ping";
  EXPECT_TRUE(client_.until([&] { return client_.count<wire::ButtonAlert>() >= 2; }))
      << "its Admin messages change both buttons";
  EXPECT_EQ(client_.count<wire::Pong>(), pings());
  EXPECT_EQ(client_.count<wire::TrackerAcceleration>(), 0U);
}

TEST_P(Conformance, ChangedAndRefusedRequestsAreReported) {
  playRest();
  for (const char* text : {
           "setEffect 2, gain 0.5 to 0.0",  // more damping than any device renders stably
           "setNormal object 0: ignored: normals follow from the triangles",
           "setNormal object 1: ignored: normals follow from the triangles",
           "transformTrimesh object 0, ",
           "setTrimeshType object -1, type 1: ignored: there is one way to collide",
           "setTrimeshType object -1, type 0: ignored: there is one way to collide",
           "startEffect (custom) 4: there is no such custom effect",
       }) {
    EXPECT_TRUE(client_.untilText(text)) << text;
  }
  EXPECT_TRUE(client_.open());
}

TEST_P(Conformance, TheResetAtTheEndRemovesTheScene) {
  ASSERT_TRUE(untilTouched(1));
  playRest();
  client_.sendBytes(recording_.reset());
  ASSERT_TRUE(untilTicks(client_, 250));  // all forces have ramped out
  client_.forget();
  ASSERT_TRUE(untilTicks(client_, 450)) << "a stroke onto each cube";
  for (const auto& touching : client_.all<wire::IsTouching>()) EXPECT_EQ(touching.touching, 0);
  EXPECT_TRUE(client_.open());
}

TEST_P(Conformance, ReportsUseTheTransportOfTheMode) {
  ASSERT_TRUE(untilTouched(0));
  playRest();
  for (const auto& message : client_.messages()) {
    const wire::MessageInfo& info = wire::info(message.kind);
    if (info.reliability == wire::Reliability::kReliable || !isUdp()) {
      EXPECT_FALSE(message.byDatagram) << info.name;
    }
  }
  EXPECT_EQ(client_.datagrams() > 0, isUdp());
}

INSTANTIATE_TEST_SUITE_P(Recorded, Conformance, testing::Values(Mode::tcp, Mode::udp),
                         [](const auto& instance) {
                           return std::string(instance.param == Mode::udp ? "UdpWithCallBack" : "TcpOnly");
                         });

}  // namespace
}  // namespace hapticd::test
