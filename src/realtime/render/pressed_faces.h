// What surfaces that a client streams need to know of the scene to share the normal force with it.
#pragma once

#include <array>
#include <cstddef>

#include "geometry/types.h"

namespace hapticd::realtime {

using geometry::Vec3;

/// The faces of meshes and planes that hold the HIP in one tick: springs of one stiffness, up to the proxy on
/// all of them. Device frame.
struct PressedFaces {
  static constexpr std::size_t kMost = 3;

  std::size_t count = 0;
  std::array<Vec3, kMost> normal;       ///< unit
  std::array<double, kMost> depth_m{};  ///< proxy - HIP = sum of depth times normal
  double stiffness_N_per_m = 0;
  double exerted =
      1;  ///< of what the springs would exert, the rest is taken by dampers or by a face that yields
  bool rest = true;  ///< nothing that is touched moves or changes

  void add(const Vec3& n, double depth) noexcept {
    normal[count] = n;
    depth_m[count++] = depth;
  }
  /// From the HIP to the proxy.
  Vec3 way_m() const noexcept {
    Vec3 way = Vec3::Zero();
    for (std::size_t i = 0; i < count; ++i) way += depth_m[i] * normal[i];
    return way;
  }
};

}  // namespace hapticd::realtime
