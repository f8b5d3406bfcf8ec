// Places on a space-filling curve (Morton 1966): what is close on it is close in space.
#pragma once

#include <cstdint>

#include "geometry/types.h"

namespace hapticd::geometry {

/// Spreads the lower 21 bits over every third bit of the result.
inline std::uint64_t everyThirdBit(std::uint64_t bits) {
  bits &= 0x1FFFFFU;
  bits = (bits | bits << 32U) & 0x1F00000000FFFFU;
  bits = (bits | bits << 16U) & 0x1F0000FF0000FFU;
  bits = (bits | bits << 8U) & 0x100F00F00F00F00FU;
  bits = (bits | bits << 4U) & 0x10C30C30C30C30C3U;
  return (bits | bits << 2U) & 0x1249249249249249U;
}

/// Of a point of the unit cube, each coordinate in 21 bits.
inline std::uint64_t placeOnCurve(const Vec3& inCube) {
  std::uint64_t place = 0;
  for (int i = 0; i < 3; ++i)
    place |= everyThirdBit(static_cast<std::uint64_t>(inCube[i] * 0x1FFFFF)) << static_cast<unsigned>(i);
  return place;
}

}  // namespace hapticd::geometry
