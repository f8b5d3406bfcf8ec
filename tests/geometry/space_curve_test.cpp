#include "geometry/space_curve.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>

namespace hapticd::geometry {
namespace {

// Bit by bit.
std::uint64_t alternating(const std::uint32_t (&coordinates)[3]) {
  std::uint64_t place = 0;
  for (unsigned bit = 0; bit < 21; ++bit)
    for (unsigned axis = 0; axis < 3; ++axis)
      place |= static_cast<std::uint64_t>(coordinates[axis] >> bit & 1U) << (3 * bit + axis);
  return place;
}

TEST(SpaceCurve, AlternatesTheBitsOfTheCoordinates) {
  std::mt19937_64 random(7);
  for (int i = 0; i < 10'000; ++i) {
    std::uint32_t cells[3];
    for (std::uint32_t& cell : cells) cell = static_cast<std::uint32_t>(random() & 0x1FFFFFU);
    const Vec3 middle((cells[0] + 0.5) / 0x1FFFFF, (cells[1] + 0.5) / 0x1FFFFF, (cells[2] + 0.5) / 0x1FFFFF);
    ASSERT_EQ(placeOnCurve(middle), alternating(cells));
  }
}

TEST(SpaceCurve, EndsAtTheLastOfItsPlaces) {
  EXPECT_EQ(placeOnCurve(Vec3::Zero()), 0U);
  EXPECT_EQ(placeOnCurve(Vec3::Ones()), (std::uint64_t{1} << 63U) - 1);
}

}  // namespace
}  // namespace hapticd::geometry
