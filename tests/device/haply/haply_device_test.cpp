// Inverse3 on a mock of its service.
#include "device/haply/haply_device.h"
#include "base/clock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <functional>

#include "device/haply/mock_service.h"
#include "device/plane_scene.h"

namespace hapticd::device {
namespace {

using testing::HasSubstr;
using namespace std::chrono_literals;

class HaplyTest : public testing::Test {
 protected:
  // Ours to the service's frame and back.
  void hand(const Vec3& p) { service.hand({p.x(), -p.z(), p.y()}); }
  Vec3 force() const {
    const Vec3 f = service.force();
    return {f.x(), f.z(), -f.y()};
  }
  // Runs like a servo, at no certain rate, until the condition holds.
  bool eventually(const std::function<bool()>& condition, const Vec3& wanted_N = Vec3::Zero()) {
    for (int i = 0; i < 5000; ++i) {
      device.write(wanted_N);
      gotState = device.read(clock.now(), state);
      if (condition()) return true;
      std::this_thread::sleep_for(1ms);
    }
    return false;
  }

  MockService service;
  HaplyDevice device{{"127.0.0.1", service.port(), ""}};
  base::MonotonicClock clock;
  DeviceState state;
  bool gotState = false;
};

std::string refusal(Device& device) {
  try {
    device.open();
    return "opened";
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

TEST_F(HaplyTest, StateArrivesInTheDeviceFrame) {
  device.open();
  hand(Vec3(0.01, 0.02, 0.03));
  service.button(true);
  EXPECT_TRUE(
      eventually([&] { return state.position_m.isApprox(Vec3(0.01, 0.02, 0.03)) && state.buttons == 2; }));
  EXPECT_TRUE(gotState);
  // A quarter turn about the service's z is one about our y.
  EXPECT_TRUE((state.orientation * Vec3::UnitX()).isApprox(Vec3(0, 0, -1)));
  EXPECT_TRUE(eventually([&] { return state.hold == kHoldNone; })) << device.faultText();
  EXPECT_FALSE(device.profile().startsArmed);
  EXPECT_GT(device.profile().transportDelay_s, 0);
}

TEST_F(HaplyTest, ForceArrivesClampedAndIsGoneAfterClose) {
  device.open();
  EXPECT_TRUE(eventually([&] { return force().isApprox(Vec3(1, 2, 3)); }, Vec3(1, 2, 3)));
  EXPECT_TRUE(eventually([&] { return force().isApprox(Vec3(0, 7, 0)); }, Vec3(0, 90, 0)));
  EXPECT_FALSE(device.write(Vec3(0, std::nan(""), 0)));
  device.close();
  EXPECT_TRUE(force().isZero());
  device.close();
  device.open();
  EXPECT_TRUE(eventually([&] { return force().isApprox(Vec3(1, 0, 0)); }, Vec3(1, 0, 0)));
}

TEST_F(HaplyTest, AForceThatIsNotRenewedIsTakenBack) {
  device.open();
  ASSERT_TRUE(eventually([&] { return force().norm() > 0.9; }, Vec3(1, 0, 0)));
  for (int i = 0; i < 5000 && !force().isZero(); ++i) std::this_thread::sleep_for(1ms);
  EXPECT_TRUE(force().isZero());
}

TEST_F(HaplyTest, SaysWhyThereIsNoDevice) {
  service.withoutDevice(true);
  EXPECT_THAT(refusal(device), HasSubstr("knows no Inverse3"));
  service.withoutDevice(false);
  service.basis("XZY");
  EXPECT_THAT(refusal(device), HasSubstr("'XZY'"));
  HaplyDevice nobody({"127.0.0.1", "1", ""});
  EXPECT_THAT(refusal(nobody), HasSubstr("haply-inverse-service"));
  HaplyDevice other({"127.0.0.1", service.port(), "OTHER"});
  EXPECT_THAT(refusal(other), HasSubstr("'OTHER'"));
}

TEST_F(HaplyTest, SilenceOfTheServiceIsAFaultUntilItSpeaksAgain) {
  device.open();
  ASSERT_TRUE(eventually([&] { return state.hold == kHoldNone && force().norm() > 0.9; }, Vec3(1, 0, 0)));
  service.mute(true);
  EXPECT_TRUE(eventually([&] { return (state.hold & kHoldFault) != 0; }, Vec3(1, 0, 0)));
  EXPECT_TRUE(eventually([&] { return force().isZero(); }, Vec3(1, 0, 0))) << "the service frees the device";
  EXPECT_TRUE(eventually([&] { return device.faultText().find("20 ms") != std::string::npos; }));
  service.mute(false);
  EXPECT_TRUE(eventually([&] { return state.hold == kHoldNone && force().norm() > 0.9; }, Vec3(1, 0, 0)));
  EXPECT_EQ(device.faultText(), "");
  EXPECT_GE(service.connections(), 2);
}

TEST_F(HaplyTest, ALostConnectionAndNonsenseAreFaultsAndHeal) {
  device.open();
  service.refuse(true);
  service.hangUp();
  EXPECT_TRUE(eventually([&] { return (state.hold & kHoldFault) != 0; }));
  service.refuse(false);
  EXPECT_TRUE(eventually([&] { return state.hold == kHoldNone; }));
  service.babble(true);
  EXPECT_TRUE(eventually([&] {
    return device.faultText().find("parse error") != std::string::npos && (state.hold & kHoldFault) != 0;
  }));
  service.babble(false);
  EXPECT_TRUE(eventually([&] { return state.hold == kHoldNone; }));
}

// Nobody is at the other one.
TEST_F(HaplyTest, AnArmIsNeverReplacedByAnother) {
  device.open();
  ASSERT_TRUE(eventually([&] { return state.hold == kHoldNone; }));
  service.another(true);
  service.hangUp();
  EXPECT_TRUE(eventually([&] { return service.connections() == 2 && state.hold == kHoldNone; }));
  EXPECT_TRUE(eventually([&] { return force().norm() > 0.9; }, Vec3(1, 0, 0))) << "the same arm";
  service.withoutDevice(true);
  EXPECT_TRUE(eventually([&] { return device.faultText().find("'MOCK1'") != std::string::npos; }))
      << device.faultText();
  EXPECT_NE(state.hold & kHoldFault, 0U);
  device.close();
  EXPECT_THAT(refusal(device), HasSubstr("'MOCK1'")) << "also when it is opened again";
  EXPECT_EQ(service.toAnother(), 0);
  HaplyDevice first({"127.0.0.1", service.port(), ""});
  first.open();
  for (int i = 0; i < 5000 && service.toAnother() == 0; ++i) std::this_thread::sleep_for(1ms);
  EXPECT_GT(service.toAnother(), 0) << "another server takes what is there";
}

TEST_F(HaplyTest, TheServicesStatusHoldsTheForce) {
  service.status(R"({"calibrated": false, "ready": true})");
  device.open();
  EXPECT_TRUE(eventually([&] { return state.hold == kHoldNotCalibrated; }, Vec3(1, 0, 0)));
  EXPECT_TRUE(force().isZero());
  EXPECT_THAT(device.faultText(), HasSubstr("not calibrated"));
  service.status(R"({"calibrated": true, "ready": false})");
  EXPECT_TRUE(eventually([&] { return state.hold == kHoldDeadMan; }, Vec3(1, 0, 0)));
  EXPECT_TRUE(force().isZero());
  EXPECT_THAT(device.faultText(), HasSubstr("power supply"));
  service.status(R"({})");
  EXPECT_TRUE(eventually([&] { return force().norm() > 0.9; }, Vec3(1, 0, 0)));
  EXPECT_EQ(device.faultText(), "");
}

TEST_F(HaplyTest, APlaneFeelsAsOnTheSimulatedDevice) {
  const std::vector<Vec3> places = plane_scene::places(40);
  const std::vector<Vec3> expected = plane_scene::referenceForces(places);
  hand(places.front());
  device.open();
  realtime::Tick servo(device, clock, plane_scene::raw());
  servo.snapshots().publish(plane_scene::snapshot());
  double most = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    hand(places[i]);
    const auto arrived = [&] {
      for (int j = 0; j < 5000; ++j) {
        servo(clock.now());
        if (servo.last().device.position_m.isApprox(places[i], 1e-9) &&
            (force() - expected[i]).norm() <= 0.01 * expected[i].norm() + 1e-9) {
          return true;
        }
        std::this_thread::sleep_for(1ms);
      }
      return false;
    };
    EXPECT_TRUE(arrived()) << "place " << i << ": " << force().transpose() << " instead of "
                           << expected[i].transpose();
    most = std::max(most, force().norm());
  }
  EXPECT_GT(most, 1.3);
}

}  // namespace
}  // namespace hapticd::device
