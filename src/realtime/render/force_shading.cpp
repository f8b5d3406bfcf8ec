#include "realtime/render/force_shading.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/rotation.h"

namespace hapticd::realtime {
namespace {

constexpr std::size_t kMostFaces = 1024;  // at a corner, in one tick
constexpr double kSharp = 0.7;            // cosine of 45 degrees: sharper edges stay edges
constexpr double kFades_rad = 0.39;  // half of that: between two faces of a sharp edge, the normal as it is

// The triangles near a place, by number: sums over them do not depend on the order of visits, which is the
// tree's.
class NearTriangles {
 public:
  NearTriangles(const scene::MeshGeometry& mesh, const Vec3& place, double radius, Nanos now) noexcept {
    mesh.indexAt(now).visitNear(place, radius, [&](std::uint32_t t) noexcept -> bool {
      if (count_ == faces_.size()) return false;
      faces_[count_++] = t;
      return true;
    });
    std::sort(faces_.begin(), faces_.begin() + static_cast<std::ptrdiff_t>(count_));
  }
  const std::uint32_t* begin() const noexcept { return faces_.data(); }
  const std::uint32_t* end() const noexcept { return faces_.data() + count_; }

 private:
  std::array<std::uint32_t, kMostFaces> faces_;
  std::size_t count_ = 0;
};

// Mean normal of the faces that meet at a corner and continue smoothly from the touched one, whose normal is
// `face`. Corners are identified by position, so that unwelded meshes work.
Vec3 cornerNormal(const PlacedObject& object, const Vec3& face, const Vec3& corner, Nanos now) {
  const scene::MeshGeometry& mesh = *object.state->mesh;
  Vec3 sum = Vec3::Zero();
  for (const std::uint32_t t : NearTriangles(mesh, corner, 0, now)) {
    const scene::Corners inObject = mesh.corners(t, now);
    const scene::Corners k = object.corners(t, now);
    Facet f;
    if (!makeFacet(k, object.skin, f) || f.normal.dot(face) < kSharp) continue;
    const auto add = [&](const Vec3& place, const Vec3& a, const Vec3& b, const Vec3& c) {
      if (place != corner) return;
      sum += std::acos(std::clamp((b - a).normalized().dot((c - a).normalized()), -1.0, 1.0)) * f.normal;
    };
    add(inObject.a, k.a, k.b, k.c);
    // A mirrored placement swaps the other two corners.
    add(object.mirrored ? inObject.c : inObject.b, k.b, k.c, k.a);
    add(object.mirrored ? inObject.b : inObject.c, k.c, k.a, k.b);
  }
  return sum;
}

// The mean normal of the corners of a face, with the weights of a place on it.
Vec3 interpolatedNormal(const PlacedObject& object, std::uint32_t triangle, const Vec3& face,
                        const Vec3& place, Nanos now) {
  const scene::Corners k = object.state->mesh->corners(triangle, now);
  geometry::Mat3 frame;
  frame << k.b - k.a, k.c - k.a, (k.b - k.a).cross(k.c - k.a);
  const Vec3 local = frame.inverse() * (object.T_object_device * place - k.a);
  const double b = std::clamp(local.x(), 0.0, 1.0);
  const double c = std::clamp(local.y(), 0.0, 1.0 - b);
  const std::array<std::pair<Vec3, double>, 3> corners{{{k.a, 1 - b - c}, {k.b, b}, {k.c, c}}};
  Vec3 sum = Vec3::Zero();
  for (const auto& [corner, weight] : corners) {
    sum += weight * cornerNormal(object, face, corner, now).stableNormalized();
  }
  return sum.stableNormalized();
}

// The faces that meet at an edge or a corner.
struct MeetingFaces {
  static constexpr std::size_t kMost = 32;
  std::array<Vec3, kMost> normals;
  std::array<std::uint32_t, kMost> triangles{};
  std::size_t count = 0;

  MeetingFaces(const PlacedObject& object, const Vec3& place, Nanos now) {
    const double near_m = 4 * object.skin;
    for (const std::uint32_t t : NearTriangles(*object.state->mesh, object.T_object_device * place,
                                               near_m * object.T_object_device.linear().norm(), now)) {
      if (count == kMost) break;
      Facet f;
      if (!makeFacet(object.corners(t, now), object.skin, f)) continue;
      if ((nearestPointOf(f, place) - place).norm() > near_m) continue;
      normals[count] = f.normal;
      triangles[count++] = t;
    }
  }
  // The one that lies most across this direction, seen from either side.
  std::size_t across(const Vec3& direction) const {
    const auto less = [&](const Vec3& a, const Vec3& b) {
      return std::abs(a.dot(direction)) < std::abs(b.dot(direction));
    };
    const auto end = normals.begin() + static_cast<std::ptrdiff_t>(count);
    return static_cast<std::size_t>(std::max_element(normals.begin(), end, less) - normals.begin());
  }
  // The direction nearest to `normal` that a mixture of the normals of this face and those that continue it
  // smoothly has. What is left of it is the nearest point to it in all half-spaces that they look away from.
  Vec3 mixtureNearestTo(const Vec3& normal, std::size_t face) const {
    constexpr int kMostSteps = 16;
    constexpr double kTolerance = 1e-12;
    std::array<HalfSpace, kMaxHalfSpaces> held;
    int heldCount = 0;
    Vec3 rest = normal;
    for (int step = 0; step < kMostSteps; ++step) {
      const Vec3* most = nullptr;
      for (std::size_t i = 0; i < count; ++i) {
        if (normals[i].dot(normals[face]) < kSharp || normals[i].dot(rest) <= kTolerance) continue;
        if (most == nullptr || normals[i].dot(rest) > most->dot(rest)) most = &normals[i];
      }
      if (most == nullptr) break;
      held[static_cast<std::size_t>(heldCount++)] = {-*most, Vec3::Zero(), 0};
      const Projection nearest =
          projectOntoActiveSet(held.data(), heldCount, normal, Vec3::Zero(), 0.1 * kTolerance);
      if (!nearest.found) break;
      rest = nearest.point;
      heldCount = nearest.count;
      for (std::size_t i = 0; i < static_cast<std::size_t>(heldCount); ++i)
        held[i] = held[static_cast<std::size_t>(nearest.active[i])];
    }
    return (normal - rest).stableNormalized();
  }
};

// The normal of a ball at an edge or a corner is between those of the faces. At a smooth edge, the shaded
// normal takes its place. At a sharp one it is turned by what shading turns the nearest of the smooth
// normals, and by less the farther it is from them: in the middle of the edge, by nothing.
Vec3 shadedAtEdge(const PlacedObject& object, const Vec3& normal, const Vec3& place, Nanos now) {
  const MeetingFaces faces(object, place, now);
  if (faces.count == 0) return normal;
  const std::size_t face = faces.across(normal);
  const double side = faces.normals[face].dot(normal) < 0 ? -1 : 1;
  const Vec3 shaded =
      side * interpolatedNormal(object, faces.triangles[face], faces.normals[face], place, now);
  const Vec3 smooth = side * faces.mixtureNearestTo(side * normal, face);
  const double apart_rad = std::acos(std::clamp(smooth.dot(normal), -1.0, 1.0));
  const double share = std::max(0.0, 1 - apart_rad / kFades_rad);
  return geometry::Quat::Identity().slerp(share, geometry::rotationBetween(smooth, shaded)) * normal;
}

}  // namespace

Vec3 shadedNormal(const PlacedObject& object, std::uint32_t triangle, Nanos now, const HalfSpace& touched,
                  const Vec3& at) noexcept {
  const Vec3& normal = touched.normal;
  Facet f;
  if (!makeFacet(object.corners(triangle, now), object.skin, f)) return normal;
  const double along = f.normal.dot(normal);
  const bool onFace = std::abs(along) > 1 - 1e-12;
  // The tool may be off the edge that it meets in this tick.
  const Vec3 place = nearestPointOf(f, onFace ? at : touched.anchor);
  const Vec3 shaded =
      onFace ? Vec3(std::copysign(1, along) * interpolatedNormal(object, triangle, f.normal, place, now))
             : shadedAtEdge(object, normal, place, now);
  return shaded.dot(normal) > 0 ? shaded : normal;
}

}  // namespace hapticd::realtime
