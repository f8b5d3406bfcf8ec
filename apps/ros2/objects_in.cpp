#include "objects_in.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <stdexcept>
#include <utility>

namespace hapticd::apps::ros2 {
namespace {

template <class Sequence>
auto elements(const Sequence& sequence) {
  return std::span(sequence._buffer, sequence._length);
}

Eigen::Vector3d eigen(const geometry_msgs_msg_dds__Point_& p) {
  return {p.x, p.y, p.z};
}

}  // namespace

ObjectsIn::ObjectsIn(Client& client, const Participant& participant, const Frame& frame, std::string base,
                     const ObjectSettings& settings)
    : client_(client), frame_(frame), base_(std::move(base)), surface_(settings.surface), log_(participant) {
  int number = settings.first;
  for (const std::string& name : settings.names)
    objects_.push_back({name,
                        number++,
                        {participant, shape_msgs_msg_dds__Mesh__desc, name + "/mesh", Delivery::state},
                        {participant, geometry_msgs_msg_dds__PoseStamped__desc, name + "/pose"},
                        {},
                        {},
                        frame_.toServer(Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero())});
  // A server that was restarted has an empty scene.
  connections_ = client.onConnection([this](const ConnectionReport&) {
    for (Object& object : objects_) object.stale = object.known;
  });
}

void ObjectsIn::take() {
  for (Object& object : objects_) {
    object.poses.take([&](const geometry_msgs_msg_dds__PoseStamped_& pose) { takePose(object, pose); });
    object.meshes.take([&](const shape_msgs_msg_dds__Mesh_& mesh) { takeMesh(object, mesh); });
    if (object.stale && client_.connected()) upload(object);
  }
}

void ObjectsIn::takePose(Object& object, const geometry_msgs_msg_dds__PoseStamped_& pose) {
  const auto& o = pose.pose.orientation;
  const Eigen::Quaterniond q(o.w, o.x, o.y, o.z);
  const Eigen::Vector3d p = eigen(pose.pose.position);
  constexpr double kRounding =
      0.01;  // of numbers that people type; a message without orientation has length 0
  std::string reason = wrongFrame(pose.header.frame_id, base_);
  if (!p.allFinite() || !(std::abs(q.norm() - 1) < kRounding))
    reason = "the position must be finite, and the orientation a quaternion of length 1";
  if (!reason.empty()) return log_.ignored(object.name + "/pose", reason);
  object.T_world_object = frame_.toServer(q.normalized(), p);
  if (object.known && !object.stale) client_.setTransform(object.number, object.T_world_object);
}

void ObjectsIn::takeMesh(Object& object, const shape_msgs_msg_dds__Mesh_& mesh) {
  const std::string topic = object.name + "/mesh";
  std::vector<std::array<float, 3>> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (const auto& point : elements(mesh.vertices)) {
    const Eigen::Vector3f v = (1000 * eigen(point)).cast<float>();
    if (!v.allFinite()) return log_.ignored(topic, "a vertex is not finite");
    vertices.push_back({v.x(), v.y(), v.z()});
  }
  for (const auto& triangle : elements(mesh.triangles)) {
    const auto& i = triangle.vertex_indices;
    if (std::max({i[0], i[1], i[2]}) >= vertices.size())
      return log_.ignored(
          topic, "a triangle names a vertex that is not there; there are " + std::to_string(vertices.size()));
    triangles.push_back({i[0], i[1], i[2]});
  }
  object.vertices = std::move(vertices);
  object.triangles = std::move(triangles);
  object.known = object.stale = true;
}

void ObjectsIn::upload(Object& object) try {
  client_.batch([&] {
    client_.setObjectCount(object.number + 1);
    client_.setObjectName(object.number, object.name);
    client_.setSurface(object.number, surface_);
    client_.setTransform(object.number, object.T_world_object);
    client_.uploadMesh(object.number, {object.vertices, object.triangles});
  });
  object.stale = false;
  log("object " + std::to_string(object.number) + " is '" + object.name +
      "': " + std::to_string(object.triangles.size()) + " triangles");
} catch (const std::length_error& error) {  // more than a batch holds
  object.stale = false;
  log_.ignored(object.name + "/mesh", error.what());
}

void ObjectsIn::clear() {
  for (const Object& object : objects_)
    if (object.known && client_.connected()) client_.clearMesh(object.number);
}

}  // namespace hapticd::apps::ros2
