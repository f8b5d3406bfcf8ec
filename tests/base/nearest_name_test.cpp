#include "base/nearest_name.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace hapticd::base {
namespace {

TEST(NearestName, IsTheOneWithTheFewestDifferences) {
  const std::vector<std::string> names{"serve", "stop", "watch", "self-test"};
  EXPECT_EQ(nearestName("serv", names), "serve");
  EXPECT_EQ(nearestName("sotp", names), "stop");
  EXPECT_EQ(nearestName("wach", names), "watch");
  EXPECT_EQ(nearestName("selftest", names), "self-test");
  EXPECT_EQ(nearestName("watch", names), "watch");
}

TEST(NearestName, IsNoneWhereAllAreFar) {
  const std::vector<std::string> names{"watch", "self-test"};
  EXPECT_EQ(nearestName("frobnicate", names), std::nullopt);
  EXPECT_EQ(nearestName("serve", {}), std::nullopt);
}

}  // namespace
}  // namespace hapticd::base
