#include "realtime/render/force_shading.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace hapticd::realtime {
namespace {

constexpr int kMostFaces = 1024;  // at a corner, in one tick
constexpr double kSharp = 0.7;    // cosine of 45 degrees: sharper edges stay edges

// Mean normal of the faces that meet at a corner and continue smoothly from the touched one, whose normal is
// `face`. Corners are identified by position, so that unwelded meshes work.
Vec3 cornerNormal(const PlacedObject& object, const Vec3& face, const Vec3& corner, Nanos now) {
  const scene::MeshGeometry& mesh = *object.state->mesh;
  Vec3 sum = Vec3::Zero();
  int visits = 0;
  mesh.index.visitNear(corner, 0, [&](std::uint32_t t) noexcept -> bool {
    if (++visits > kMostFaces) return false;
    const scene::Corners inObject = mesh.corners(t, now);
    const scene::Corners k = object.corners(t, now);
    Facet f;
    if (!makeFacet(k, object.skin, f) || f.normal.dot(face) < kSharp) return true;
    const auto add = [&](const Vec3& place, const Vec3& a, const Vec3& b, const Vec3& c) {
      if (place != corner) return;
      sum += std::acos(std::clamp((b - a).normalized().dot((c - a).normalized()), -1.0, 1.0)) * f.normal;
    };
    add(inObject.a, k.a, k.b, k.c);
    // A mirrored placement swaps the other two corners.
    add(object.mirrored ? inObject.c : inObject.b, k.b, k.c, k.a);
    add(object.mirrored ? inObject.b : inObject.c, k.c, k.a, k.b);
    return true;
  });
  return sum;
}

}  // namespace

Vec3 shadedNormal(const PlacedObject& object, std::uint32_t triangle, Nanos now, const Vec3& normal,
                  const Vec3& at) noexcept {
  const scene::Corners k = object.state->mesh->corners(triangle, now);
  Facet f;
  if (!makeFacet(object.corners(triangle, now), object.skin, f)) return normal;
  const double side = f.normal.dot(normal) < 0 ? -1 : 1;
  geometry::Mat3 frame;
  frame << k.b - k.a, k.c - k.a, (k.b - k.a).cross(k.c - k.a);
  const Vec3 local = frame.inverse() * (object.T_object_device * nearestPointOf(f, at) - k.a);
  const double b = std::clamp(local.x(), 0.0, 1.0);
  const double c = std::clamp(local.y(), 0.0, 1.0 - b);
  const std::array<std::pair<Vec3, double>, 3> corners{{{k.a, 1 - b - c}, {k.b, b}, {k.c, c}}};
  Vec3 sum = Vec3::Zero();
  for (const auto& [corner, weight] : corners) {
    sum += weight * cornerNormal(object, f.normal, corner, now).stableNormalized();
  }
  const Vec3 shaded = side * sum.stableNormalized();
  return shaded.dot(normal) > 0 ? shaded : normal;
}

}  // namespace hapticd::realtime
