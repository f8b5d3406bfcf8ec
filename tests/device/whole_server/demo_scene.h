// The scene that a client uploads to every device, a stroke of the hand through it, and the force that the
// simulated device gets at each place of the stroke.
#pragma once

#include <vector>

#include "geometry/triangle_mesh.h"
#include "geometry/types.h"
#include "hapticd/client.h"
#include "mocks/arm_block.h"

namespace hapticd::whole_server {

using geometry::Vec3;

/// Two bumpy sheets with friction, one above the other's rim, and a spring that pulls all the time.
struct DemoScene {
  float stiffness = 0.4F;  ///< of the reference, 500 N/m
  double depth_m = 0.003;  ///< of the stroke
  int places = 240;        ///< of the stroke
  bool friction = true;

  geometry::TriangleMesh mesh(int object) const;
  /// Sends everything in one batch, instead of what was there.
  void upload(Client& client) const;
  /// Down from free air, aslant through both sheets, and up again: as often as one likes.
  std::vector<Vec3> stroke() const;
  void script(mock::ArmBlock& block) const;
  /// Of the open-loop simulated device, tick by tick.
  std::vector<Vec3> forces(const std::vector<Vec3>& places_m) const;
  /// At the places of the stroke, when it is not the first.
  std::vector<Vec3> strokeForces() const;
};

inline constexpr int kObjects = 2;

}  // namespace hapticd::whole_server
