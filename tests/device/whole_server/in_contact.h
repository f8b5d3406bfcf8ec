// A hand that presses into the demo scene of a whole server, and stays there.
#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "device/whole_server/event_kernel.h"
#include "device/whole_server/served_device.h"

namespace hapticd::whole_server {

inline constexpr double kNothing_N = 1e-9;

class InContact : public testing::Test {
 protected:
  InContact() {
    scene.friction = false;  // the force of a resting hand then stays
    scene.script(*arm);
    expected = scene.strokeForces();
    deep = scene.places / 2;
  }
  void serve(std::vector<std::string> arguments, std::vector<std::string> environment) {
    arguments.emplace_back("--enable-forces");
    environment.push_back("HAPTICD_MOCK_ARM=" + work.file("arm"));
    server.emplace(work, arguments, environment);
    const std::string address = server->address();
    ASSERT_FALSE(address.empty()) << server->log();
    visit(address);
  }
  void visit(const std::string& address) {
    visitor.emplace(address);
    scene.upload(visitor->client());
    ASSERT_TRUE(visitor->until([&] {
      visitor->untilReady();
      return arm->ticks > 0 && right(arm->ticks - 1);
    })) << server->log();
    touch();
  }
  // The hand goes to the deepest place, as a hand does, and is pushed there. One that is there leaves it
  // first.
  void touch() {
    arm->rest = -1;
    bool leaving = true;
    ASSERT_TRUE(visitor->until([&] {
      if (visitor->latched()) visitor->client().rearmForces();
      const std::int64_t tick = arm->ticks - 1;
      const bool away = tick < 0 || arm.at(tick).place != deep;
      if (away || leaving) {
        leaving = leaving && !away;
        return false;
      }
      arm->rest = deep;
      if (right(tick)) return true;
      // What was first met in the depth is felt only when the hand has left.
      const bool released =
          arm.force(tick).norm() < kNothing_N || !visitor->client().latest().guard.latched.empty();
      if (released || ++waited_ % 1000 == 0) {
        arm->rest = -1;
        leaving = true;
      }
      return false;
    })) << arm.left().transpose()
        << " instead of " << expected[static_cast<std::size_t>(deep)].transpose() << "\n"
        << server->log();
  }
  bool right(std::int64_t tick) const {
    const Vec3& wanted = expected[static_cast<std::size_t>(arm.at(tick).place)];
    return (arm.force(tick) - wanted).norm() <= 0.01 * wanted.norm();
  }
  // From the first tick with the fault on, no more than so many have a force; and it does not come back by
  // itself.
  void strike(mock::Fault fault, int ticksWithForce) {
    const std::int64_t before = arm->ticks;
    arm->fault = fault;
    std::int64_t first = before;
    ASSERT_TRUE(visitor->until([&] {
      while (first < arm->ticks && arm.at(first).fault != fault) ++first;
      return first < arm->ticks && arm->ticks > first + ticksWithForce + kWatched;
    })) << server->log();
    int withForce = 0;  // between them the guard of a stalled machine may have ended it for a while
    for (std::int64_t tick = first; tick < first + ticksWithForce + kWatched; ++tick) {
      if (arm.force(tick).norm() > kNothing_N) ++withForce;
    }
    EXPECT_LE(withForce, ticksWithForce) << server->log();
    std::printf("fault %d: %d ticks with force, %d promised\n", fault, withForce, ticksWithForce);
  }
  void expectWords(const std::string& words) {
    EXPECT_TRUE(visitor->until([&] { return visitor->heard(words); })) << words << " is not in\n"
                                                                       << visitor->texts() << "the log:\n"
                                                                       << server->log();
  }
  // The fault is over: forces come back, after a re-arm where the guard latched one.
  void heal(bool reopens) {
    const int opened = arm->opened;
    visitor->forget();  // a stall before may have made the device work again, too
    arm->fault = mock::kHealthy;
    if (reopens) {
      EXPECT_TRUE(visitor->until([&] { return arm->opened > opened; })) << server->log();
    }
    expectWords("the device works again");
    touch();
  }
  void serveJoystick() {
    const std::string file = work.file("event0");
    // A sanitizer wants to be loaded first.
    server.emplace(work, std::vector<std::string>{"--device", "evdev:" + file, "--enable-forces"},
                   std::vector<std::string>{"LD_PRELOAD=" MOCK_EVENT, "HAPTICD_MOCK_EVENT=" + file,
                                            "ASAN_OPTIONS=verify_asan_link_order=0:detect_leaks=0"});
    const std::string address = server->address();
    ASSERT_FALSE(address.empty()) << server->log();
    visitor.emplace(address);
    scene.upload(visitor->client());
  }
  // In from the air, again and again: what a stall took comes back there. A stall in the depth releases the
  // hand behind the sheet, which then holds it there from below: without the sheet it gets out.
  bool pressJoystick(EventKernel& kernel, device::FakeJoystick& joystick) {
    const auto glide = [&](double from, double to) {
      for (int i = 1; i <= 40; ++i) {
        kernel.move(0, from + (to - from) * i / 40);
        visitor->client().runFor(4ms);
      }
    };
    return visitor->until([&] {
      visitor->untilReady();
      glide(0.1, -0.1);
      visitor->client().runFor(600ms);
      if (joystick.force().second > 0.1) return true;
      glide(-0.1, 0.1);
      visitor->client().resetScene();
      visitor->client().runFor(100ms);
      scene.upload(visitor->client());
      return false;
    });
  }
  void endInOrder() {
    server->signal(SIGTERM);
    EXPECT_EQ(server->end(), 0) << server->log();
    EXPECT_TRUE(arm.left().isZero());
  }

  static constexpr int kWatched = 60;
  DemoScene scene;
  const WorkDirectory work;
  const SharedArm arm{work.file("arm")};
  std::vector<Vec3> expected;
  int deep = 0;
  std::optional<ServerProcess> server;
  std::optional<Visitor> visitor;

 private:
  int waited_ = 0;
};

}  // namespace hapticd::whole_server
