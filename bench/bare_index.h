// Embree alone, over the triangles themselves: the yardstick of the index and of refitting.
#pragma once

#include <embree3/rtcore.h>

#include "geometry/triangle_mesh.h"

namespace hapticd::bench {

/// A robust triangle scene with nothing around it.
class BareIndex {
 public:
  enum class Kind { fixed, refitted };
  /// Vertices are multiplied by `scale` first. Throws std::runtime_error when Embree refuses.
  explicit BareIndex(const geometry::TriangleMesh& mesh, float scale = 1, Kind kind = Kind::fixed);
  ~BareIndex();
  BareIndex(const BareIndex&) = delete;
  BareIndex& operator=(const BareIndex&) = delete;

  /// Parameter of the first hit of the segment, or above 1.
  float firstHit(const geometry::Vec3f& from, const geometry::Vec3f& to) const noexcept {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit ray;
    ray.ray.org_x = from.x();
    ray.ray.org_y = from.y();
    ray.ray.org_z = from.z();
    ray.ray.dir_x = to.x() - from.x();
    ray.ray.dir_y = to.y() - from.y();
    ray.ray.dir_z = to.z() - from.z();
    ray.ray.tnear = 0;
    ray.ray.tfar = 1;
    ray.ray.time = 0;
    ray.ray.mask = 0xFFFFFFFFU;
    ray.ray.flags = 0;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene_, &context, &ray);
    return ray.hit.geomID == RTC_INVALID_GEOMETRY_ID ? 2.0F : ray.ray.tfar;
  }

  /// New places of all vertices, of Kind::refitted: refits the tree.
  void refit(const std::vector<geometry::Vec3f>& vertices);

 private:
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  RTCGeometry geometry_ = nullptr;
  float* vertices_ = nullptr;
};

}  // namespace hapticd::bench
