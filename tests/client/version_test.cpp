#include <gtest/gtest.h>

#include <string>

#include "hapticd/version.h"

namespace hapticd::test {
namespace {

TEST(Version, IsTheVersionOfTheProject) {
  EXPECT_STREQ(HAPTICD_VERSION_STRING, HAPTICD_PROJECT_VERSION);
  EXPECT_EQ(HAPTICD_VERSION_STRING, std::to_string(HAPTICD_VERSION_MAJOR) + '.' +
                                        std::to_string(HAPTICD_VERSION_MINOR) + '.' +
                                        std::to_string(HAPTICD_VERSION_PATCH));
}

TEST(Version, IsComparedAsOneNumber) {
  EXPECT_EQ(HAPTICD_VERSION,
            HAPTICD_MAKE_VERSION(HAPTICD_VERSION_MAJOR, HAPTICD_VERSION_MINOR, HAPTICD_VERSION_PATCH));
  EXPECT_LT(HAPTICD_MAKE_VERSION(0, 1, 99), HAPTICD_MAKE_VERSION(0, 2, 0));
  EXPECT_LT(HAPTICD_MAKE_VERSION(0, 99, 99), HAPTICD_MAKE_VERSION(1, 0, 0));
}

}  // namespace
}  // namespace hapticd::test
