// A scene that somebody feels, a peer that says wrong things, and the question whether the first one noticed.
#pragma once

#include <gtest/gtest.h>

#include "feeling.h"
#include "hands.h"
#include "log_lines.h"

namespace hapticd::test {

/// The good peer owns a cube and feels it at each stroke.
class BadInput : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(good_.untilConnected());
    ASSERT_TRUE(bad_.untilConnected());
    sendCube(good_);
    ASSERT_TRUE(isIntact());
  }

  // Whether the good peer is connected and feels what it felt: the cube's top, as stiff as it was, in a world
  // of the same size.
  bool isIntact() {
    return catchUp(good_) && untilTouchedAt(good_, 0, kCubeTop_m) && good_.until([&] {
      const auto depth = good_.last<wire::Dop>();
      return depth && std::abs(depth->depth - kDepth_m) < 2e-4;
    }) && good_.open();
  }
  // Whether the bad peer is told in these words, and still served.
  testing::AssertionResult isTold(const std::string& words) {
    if (!bad_.untilText(words)) return testing::AssertionFailure() << "no text with '" << words << "'";
    if (!bad_.open()) return testing::AssertionFailure() << "closed: " << bad_.closeReason();
    return testing::AssertionSuccess();
  }
  bool untilLogged(const std::string& words) {
    return good_.until([&] { return log_.count(words) > 0; });
  }

  // The hand wants 5 mm and is a spring of 300 N/m against the cube's of 500 N/m.
  static constexpr double kDepth_m = 0.005 * 300 / 800;

  LogLines log_;
  const Hand hand_ = Hand::stroking();
  RunningServer server_{hand_.config()};
  ScriptedPeer good_{server_.address()};
  ScriptedPeer bad_{server_.address()};
};

}  // namespace hapticd::test
