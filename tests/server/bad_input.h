// A fixture for bad input: one peer touches a scene, another sends bad input, and the first must not be
// affected.
#pragma once

#include <gtest/gtest.h>

#include "feeling.h"
#include "hands.h"
#include "log_lines.h"

namespace hapticd::test {

/// The good peer owns a cube and touches it at each stroke.
class BadInput : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(good_.untilConnected());
    ASSERT_TRUE(bad_.untilConnected());
    sendCube(good_);
    ASSERT_TRUE(isIntact());
  }

  // Whether the good peer is connected and touches the same cube: same height, stiffness and world scale.
  bool isIntact() {
    return catchUp(good_) && untilTouchedAt(good_, 0, kCubeTop_m) && good_.until([&] {
      const auto depth = good_.last<wire::Dop>();
      return depth && std::abs(depth->depth - kDepth_m) < 2e-4;
    }) && good_.open();
  }
  // Whether the bad peer got this text and is still connected.
  testing::AssertionResult gotText(const std::string& text) {
    if (!bad_.untilText(text)) return testing::AssertionFailure() << "no text with '" << text << "'";
    if (!bad_.open()) return testing::AssertionFailure() << "closed: " << bad_.closeReason();
    return testing::AssertionSuccess();
  }
  bool untilLogged(const std::string& text) {
    return good_.until([&] { return log_.count(text) > 0; });
  }

  // The target is 5 mm deep; the hand is a spring of 300 N/m against the cube of 500 N/m.
  static constexpr double kDepth_m = 0.005 * 300 / 800;

  LogLines log_;
  const Hand hand_ = Hand::stroking();
  RunningServer server_{hand_.config()};
  ScriptedPeer good_{server_.address()};
  ScriptedPeer bad_{server_.address()};
};

}  // namespace hapticd::test
