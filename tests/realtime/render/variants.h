// The same scene in millimetres, in metres, in large cells of a foreign unit, and 10 m from the origin: what
// is felt must not depend on it.
#pragma once

#include <gtest/gtest.h>

#include <ostream>
#include <string>

#include "meshes.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {

struct Variant {
  const char* name;
  double worldUnitsPerMetre;
  double offset_m;  ///< of everything, in x, y and z, in the object's transform
};

inline void PrintTo(const Variant& v, std::ostream* out) {
  *out << v.name;
}

/// Meshes and hands are given in metres near the origin; the variant decides what the scene makes of them.
class VariantTest : public testing::TestWithParam<Variant> {
 protected:
  VariantTest() { scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre); }

  Vec3 offset() const { return Vec3::Constant(GetParam().offset_m); }

  scene::ObjectState& add(TriangleMesh mesh, const scene::Surface& s) {
    const double units = GetParam().worldUnitsPerMetre;
    geometry::scaleAndMove(mesh, units, Vec3::Zero());
    return scene.add(mesh, s, Affine(Eigen::Translation3d(units * offset())));
  }
  /// Puts the hand at p and lets it go from there.
  Hand& start(const Vec3& p, const RenderOptions& options = {}) {
    hand = std::make_unique<Hand>(scene.snapshot(), options);
    hand->at(p + offset());
    return *hand;
  }
  const Rendering& at(const Vec3& p) { return hand->at(p + offset()); }
  template <class Each>
  const Rendering& to(const Vec3& p, double speed, Each&& each) {
    return hand->to(p + offset(), speed, each);
  }
  const Rendering& to(const Vec3& p, double speed = 0.1) { return hand->to(p + offset(), speed); }
  Vec3 hip() const { return hand->hip() - offset(); }
  Vec3 proxy() const { return hand->now().proxy_m - offset(); }

  SceneFixture scene;
  std::unique_ptr<Hand> hand;
};

inline const auto kVariants = testing::Values(Variant{"millimetres", 1000, 0}, Variant{"metres", 1, 0},
                                              Variant{"inches", 39.37, 0}, Variant{"far", 1000, 10});
inline std::string variantName(const testing::TestParamInfo<Variant>& info) {
  return info.param.name;
}

}  // namespace hapticd::realtime::fixture
