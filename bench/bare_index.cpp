#include "bench/bare_index.h"

#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace hapticd::bench {

BareIndex::BareIndex(const geometry::TriangleMesh& mesh, float scale, Kind kind)
    : device_(rtcNewDevice(std::getenv("HAPTICD_EMBREE"))) {
  if (device_ == nullptr) throw std::runtime_error("Embree did not start; check HAPTICD_EMBREE");
  scene_ = rtcNewScene(device_);
  geometry_ = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  const bool refitted = kind == Kind::refitted;
  rtcSetSceneFlags(scene_, refitted ? RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC : RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene_, refitted ? RTC_BUILD_QUALITY_LOW : RTC_BUILD_QUALITY_MEDIUM);
  rtcSetGeometryBuildQuality(geometry_, refitted ? RTC_BUILD_QUALITY_REFIT : RTC_BUILD_QUALITY_MEDIUM);
  vertices_ = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry_, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), mesh.vertices.size()));
  auto* triangles = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry_, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), mesh.triangles.size()));
  if (vertices_ == nullptr || triangles == nullptr)
    throw std::runtime_error("Embree has no memory for the mesh");
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis)
      vertices_[3 * i + static_cast<std::size_t>(axis)] = scale * mesh.vertices[i][axis];
  }
  std::memcpy(triangles, mesh.triangles.data(), mesh.triangles.size() * sizeof(geometry::Triangle));
  rtcCommitGeometry(geometry_);
  rtcAttachGeometry(scene_, geometry_);
  rtcCommitScene(scene_);
}

BareIndex::~BareIndex() {
  rtcReleaseGeometry(geometry_);
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

void BareIndex::refit(const std::vector<geometry::Vec3f>& vertices) {
  std::memcpy(vertices_, vertices.data(), vertices.size() * sizeof(geometry::Vec3f));
  rtcUpdateGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0);
  rtcCommitGeometry(geometry_);
  rtcCommitScene(scene_);
}

}  // namespace hapticd::bench
