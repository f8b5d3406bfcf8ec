#include "commands_in.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include "base/printable.h"
#include "hapticd/error.h"

namespace hapticd::apps::ros2 {
namespace {

template <class Sequence>
auto elements(const Sequence& sequence) {
  return std::span(sequence._buffer, sequence._length);
}

template <class Vector>
Eigen::Vector3d eigen(const Vector& v) {
  return {v.x, v.y, v.z};
}

constexpr const char* kForces = "servo_cf";
constexpr const char* kStates = "state_command";

}  // namespace

void log(const std::string& text) {
  std::printf("hapticd-ros2: %s\n", text.c_str());
  std::fflush(stdout);
}

CommandsIn::CommandsIn(Client& client, const Participant& participant, const Frame& frame, std::string base,
                       const ObjectSettings& objects)
    : client_(client),
      participant_(participant),
      frame_(frame),
      base_(std::move(base)),
      surface_(objects.surface),
      forces_(participant, geometry_msgs_msg_dds__WrenchStamped__desc, kForces),
      states_(participant, crtk_msgs_msg_dds__StringStamped__desc, kStates, Delivery::state) {
  int number = objects.first;
  for (const std::string& name : objects.names)
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

void CommandsIn::take() {
  takeStates();  // a stop first
  takeForces();
  for (Object& object : objects_) takeObject(object);
}

void CommandsIn::takeForces() {
  std::optional<geometry_msgs_msg_dds__Wrench_> newest;
  forces_.take([&](const geometry_msgs_msg_dds__WrenchStamped_& sample) {
    newest.reset();
    const Eigen::Vector3d sum = eigen(sample.wrench.force) + eigen(sample.wrench.torque);
    if (!inBase(sample.header.frame_id, kForces)) return;
    if (!sum.allFinite()) return problem(kForces, "a force or torque is not finite");
    newest = sample.wrench;
  });
  if (newest) client_.setForce(frame_.toServer(eigen(newest->force)), frame_.toServer(eigen(newest->torque)));
}

void CommandsIn::takeStates() {
  states_.take([&](const crtk_msgs_msg_dds__StringStamped_& sample) {
    const std::string text = sample.text;
    try {
      if (text == "disable" || text == "pause") {
        client_.stopForces();
        log("stopped by " + participant_.fullName(kStates));
      } else if (text == "enable" || text == "resume") {
        client_.rearmForces();
        log("re-armed by " + participant_.fullName(kStates));
      } else {
        problem(kStates,
                "'" + base::printable(text) + "' is not known; known are disable, pause, enable and resume");
      }
    } catch (const Error& error) {
      log(std::string(kStates) + ": " + text + " failed: " + error.what());
    }
  });
}

void CommandsIn::takeObject(Object& object) {
  object.poses.take([&](const geometry_msgs_msg_dds__PoseStamped_& pose) { takePose(object, pose); });
  object.meshes.take([&](const shape_msgs_msg_dds__Mesh_& mesh) { takeMesh(object, mesh); });
  if (object.stale && client_.connected()) upload(object);
}

void CommandsIn::takePose(Object& object, const geometry_msgs_msg_dds__PoseStamped_& pose) {
  const std::string topic = object.name + "/pose";
  if (!inBase(pose.header.frame_id, topic)) return;
  const auto& o = pose.pose.orientation;
  Eigen::Quaterniond q(o.w, o.x, o.y, o.z);
  const Eigen::Vector3d p = eigen(pose.pose.position);
  const double length = q.norm();
  // Others forget to set w, which is 0 then.
  if (!p.allFinite() || !(std::abs(length - 1) < 0.01))
    return problem(topic, "the position must be finite, and the orientation a quaternion of length 1");
  object.T_world_object = frame_.toServer(q.normalized(), p);
  if (object.known && !object.stale) client_.setTransform(object.number, object.T_world_object);
}

void CommandsIn::takeMesh(Object& object, const shape_msgs_msg_dds__Mesh_& mesh) {
  const std::string topic = object.name + "/mesh";
  std::vector<std::array<float, 3>> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (const auto& point : elements(mesh.vertices)) {
    const Eigen::Vector3f v = (1000 * eigen(point)).cast<float>();
    if (!v.allFinite()) return problem(topic, "a vertex is not finite");
    vertices.push_back({v.x(), v.y(), v.z()});
  }
  for (const auto& triangle : elements(mesh.triangles)) {
    const auto& i = triangle.vertex_indices;
    if (std::max({i[0], i[1], i[2]}) >= vertices.size())
      return problem(
          topic, "a triangle names a vertex that is not there; there are " + std::to_string(vertices.size()));
    triangles.push_back({i[0], i[1], i[2]});
  }
  object.vertices = std::move(vertices);
  object.triangles = std::move(triangles);
  object.known = object.stale = true;
}

void CommandsIn::upload(Object& object) try {
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
} catch (const Error& error) {
  object.stale = false;  // until the next connection
  log("'" + object.name + "' is not uploaded: " + error.what());
}

bool CommandsIn::inBase(const char* frame, const std::string& topic) {
  const std::string name = frame;
  if (name.empty() || name == base_) return true;
  problem(topic, "frame_id is '" + base::printable(name) + "'; transform the message into '" + base_ +
                     "', or leave frame_id empty");
  return false;
}

void CommandsIn::problem(const std::string& topic, const std::string& text) {
  if (std::exchange(problems_[topic], text) != text)
    log(participant_.fullName(topic) + " is ignored: " + text);
}

void CommandsIn::end() {
  try {
    for (const Object& object : objects_)
      if (object.known && client_.connected()) client_.clearMesh(object.number);
  } catch (const Error& error) {
    log(std::string("the objects stay in the scene: ") + error.what());
  }
}

}  // namespace hapticd::apps::ros2
