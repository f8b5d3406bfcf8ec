#include "server/scene/command_decoder.h"

#include <algorithm>
#include <limits>

#include "wire/dispatch.h"

namespace hapticd::server {
namespace {

using geometry::Vec3;

Vec3 vec3(const wire::F32x3& v) {
  return {v[0], v[1], v[2]};
}
Vec3 vec3(const wire::F64x3& v) {
  return {v[0], v[1], v[2]};
}

template <class To, class From, std::size_t N>
std::array<To, N> arrayOf(const std::array<From, N>& from) {
  std::array<To, N> to{};
  std::copy(from.begin(), from.end(), to.begin());
  return to;
}

// The paper's interface.
scene::SceneCommand toCommand(const wire::SetObjectNumber& m) {
  return scene::SetObjectNumber{m.count};
}
scene::SceneCommand toCommand(const wire::SetTransformMatrix& m) {
  return scene::SetTransform{m.object, m.matrix};
}
scene::SceneCommand toCommand(const wire::SetHapticProperty& m) {
  return scene::SetSurfaceProperty{m.object, std::string(m.property.view()), m.value};
}
scene::SceneCommand toCommand(const wire::SetTouchableFace& m) {
  return scene::SetTouchableFaces{m.face};
}
scene::SceneCommand toCommand(const wire::SetWorkspaceProjectionMatrix& m) {
  return scene::SetWorkspaceProjection{m.model, m.projection};
}
scene::SceneCommand toCommand(const wire::SetWorkspaceBoundingBox& m) {
  return scene::SetWorkspaceBox{m.model, m.box};
}
scene::SceneCommand toCommand(const wire::Effect& m) {
  return scene::DefineEffect{.type = std::string(m.type.view()),
                             .index = m.index,
                             .gain = m.gain,
                             .magnitude_N = m.magnitude,
                             .duration_ms = m.duration,
                             .frequency = m.frequency,
                             .position = vec3(m.position),
                             .direction = vec3(m.direction)};
}
scene::SceneCommand toCommand(const wire::StartEffect& m) {
  return scene::StartEffect{m.index};
}
scene::SceneCommand toCommand(const wire::StopEffect& m) {
  return scene::StopEffect{m.index};
}
scene::SceneCommand toCommand(const wire::SetObjectIsTouchable& m) {
  return scene::SetTouchable{m.object, m.touchable != 0};
}
scene::SceneCommand toCommand(const wire::ResetScene&) {
  return scene::ResetScene{};
}

// Stock objects and meshes.
scene::SceneCommand toCommand(const wire::AddObject& m) {
  return scene::AddObject{m.object, m.parent};
}
scene::SceneCommand toCommand(const wire::AddObjectExScene& m) {
  return scene::AddObjectExScene{m.object};
}
scene::SceneCommand toCommand(const wire::MoveToParent& m) {
  return scene::MoveToParent{m.object, m.parent};
}
scene::SceneCommand toCommand(const wire::SetObjectPosition& m) {
  return scene::SetObjectPosition{m.object, vec3(m.position)};
}
scene::SceneCommand toCommand(const wire::SetObjectOrientation& m) {
  return scene::SetObjectOrientation{m.object, vec3(m.axis), m.angle};
}
scene::SceneCommand toCommand(const wire::SetObjectScale& m) {
  return scene::SetObjectScale{m.object, vec3(m.scale)};
}
scene::SceneCommand toCommand(const wire::RemoveObject& m) {
  return scene::RemoveObject{m.object};
}
scene::SceneCommand toCommand(const wire::SetNormal& m) {
  return scene::SetNormal{m.object};
}
scene::SceneCommand toCommand(const wire::RemoveTriangle& m) {
  return scene::RemoveTriangle{m.object, m.triangle};
}
scene::SceneCommand toCommand(const wire::UpdateTrimeshChanges& m) {
  return scene::SetSurface{.object = m.object,
                           .stiffness = m.stiffness,
                           .damping = m.damping,
                           .staticFriction = m.static_friction,
                           .dynamicFriction = m.dynamic_friction};
}
scene::SceneCommand toCommand(const wire::TransformTrimesh& m) {
  return scene::TransformMesh{m.object, m.matrix};
}
scene::SceneCommand toCommand(const wire::SetTrimeshType& m) {
  return scene::SetTrimeshType{m.object, m.type};
}
scene::SceneCommand toCommand(const wire::ClearTrimesh& m) {
  return scene::ClearMesh{m.object};
}
scene::SceneCommand toCommand(const wire::SetHapticOrigin& m) {
  return scene::SetHapticOrigin{vec3(m.position), vec3(m.axis), m.angle};
}
scene::SceneCommand toCommand(const wire::SetHapticScale& m) {
  return scene::SetHapticScale{m.scale};
}
scene::SceneCommand toCommand(const wire::SetSceneOrigin& m) {
  return scene::SetSceneOrigin{vec3(m.position), vec3(m.axis), m.angle};
}

// Stock forces that belong to no object.
scene::SceneCommand toCommand(const wire::Plane& m) {
  return scene::SetPlane{.index = m.index,
                         .plane = arrayOf<double>(m.plane),
                         .stiffness = m.stiffness,
                         .damping = m.damping,
                         .staticFriction = m.static_friction,
                         .dynamicFriction = m.dynamic_friction,
                         .recoveryCycles = m.recovery_cycles};
}
scene::SceneCommand toCommand(const wire::Plane2& m) {
  return scene::SetPlaneDetail{.adhesionNormal_N = m.normal_adhesion,
                               .adhesionLateral_N = m.lateral_adhesion,
                               .textureAmplitude_m = m.texture_amplitude,
                               .textureWavelength_m = m.texture_wavelength,
                               .buzzAmplitude_m = m.buzz_amplitude,
                               .buzzFrequency_Hz = m.buzz_frequency};
}
scene::SceneCommand toCommand(const wire::ForceField& m) {
  return scene::SetForceField{vec3(m.origin), vec3(m.force), arrayOf<double>(m.jacobian), m.radius};
}
scene::SceneCommand toCommand(const wire::ConstraintEnable& m) {
  return scene::SetConstraintEnabled{m.enable != 0};
}
scene::SceneCommand toCommand(const wire::ConstraintMode& m) {
  return scene::SetConstraintMode{m.mode};
}
scene::SceneCommand toCommand(const wire::ConstraintPoint& m) {
  return scene::SetConstraintVector{scene::ConstraintVector::point, vec3(m.point)};
}
scene::SceneCommand toCommand(const wire::ConstraintLinePoint& m) {
  return scene::SetConstraintVector{scene::ConstraintVector::linePoint, vec3(m.point)};
}
scene::SceneCommand toCommand(const wire::ConstraintLineDirection& m) {
  return scene::SetConstraintVector{scene::ConstraintVector::lineDirection, vec3(m.direction)};
}
scene::SceneCommand toCommand(const wire::ConstraintPlanePoint& m) {
  return scene::SetConstraintVector{scene::ConstraintVector::planePoint, vec3(m.point)};
}
scene::SceneCommand toCommand(const wire::ConstraintPlaneNormal& m) {
  return scene::SetConstraintVector{scene::ConstraintVector::planeNormal, vec3(m.normal)};
}
scene::SceneCommand toCommand(const wire::ConstraintStiffness& m) {
  return scene::SetConstraintStiffness{m.stiffness};
}
scene::SceneCommand toCommand(const wire::CustomEffect& m) {
  if (m.effect == wire::kStopCustomEffect) return scene::StopCustomEffect{};
  return scene::StartCustomEffect{m.effect, m.parameters.values};
}

// Our own.
scene::SceneCommand toCommand(const wire::BatchBegin&) {
  return scene::BeginBatch{};
}
scene::SceneCommand toCommand(const wire::BatchCommit&) {
  return scene::CommitBatch{};
}
scene::SceneCommand toCommand(const wire::MeshVertices& m) {
  scene::SetVertices run{m.object, m.first, {}};
  const std::vector<float>& numbers = m.positions.values;
  run.positions.reserve(numbers.size() / 3);
  for (std::size_t i = 0; i + 2 < numbers.size(); i += 3)
    run.positions.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
  return run;
}

// A negative vertex becomes one that no mesh has, and the scene names it in its refusal.
std::uint32_t corner(std::int32_t vertex) {
  return vertex < 0 ? std::numeric_limits<std::uint32_t>::max() : static_cast<std::uint32_t>(vertex);
}

scene::SceneCommand toCommand(const wire::MeshTriangles& m) {
  scene::SetTriangles run{m.object, m.first, {}, false};
  const std::vector<std::int32_t>& numbers = m.vertices.values;
  run.triangles.reserve(numbers.size() / 3);
  for (std::size_t i = 0; i + 2 < numbers.size(); i += 3)
    run.triangles.push_back({corner(numbers[i]), corner(numbers[i + 1]), corner(numbers[i + 2])});
  return run;
}

// What a run holds besides its task.
std::size_t bytesOf(const wire::MeshVertices& m) {
  return m.positions.values.size() * sizeof(float);
}
std::size_t bytesOf(const wire::MeshTriangles& m) {
  return m.vertices.values.size() * sizeof(std::int32_t);
}
template <class M>
std::size_t bytesOf(const M&) {
  return 0;
}

// Numbers of a bulk message come by three.
template <class M>
bool isWhole(const M& message, std::string& error) {
  std::size_t numbers = 0;
  if constexpr (std::is_same_v<M, wire::MeshVertices>) numbers = message.positions.values.size();
  if constexpr (std::is_same_v<M, wire::MeshTriangles>) numbers = message.vertices.values.size();
  if (numbers % 3 == 0) return true;
  error = std::string(M::kInfo.name) + ": a list of " + std::to_string(numbers) +
          " numbers, which is no multiple of three";
  return false;
}

// The last task, if it is a run of this client for this object.
template <class Run>
Run* lastRun(std::vector<SceneTask>& tasks, scene::ClientId client, std::int32_t object) {
  if (tasks.empty() || tasks.back().client != client) return nullptr;
  auto* command = std::get_if<scene::SceneCommand>(&tasks.back().what);
  Run* run = command != nullptr ? std::get_if<Run>(command) : nullptr;
  return run != nullptr && run->object == object ? run : nullptr;
}

bool continues(std::int32_t first, std::size_t count, std::int32_t next) {
  return first >= 0 && static_cast<std::int64_t>(first) + static_cast<std::int64_t>(count) == next;
}

}  // namespace

CommandDecoder::Outcome CommandDecoder::take(scene::ClientId client, const wire::MessageReceived& message,
                                             std::string& error) {
  if (wire::role(message.kind) != wire::Role::scene) return Outcome::notACommand;
  std::string broken;
  const auto handle = [&]<class M>(const M& m) {
    if constexpr (std::is_same_v<M, wire::SetVertex>) {
      addVertex(client, m);
    } else if constexpr (std::is_same_v<M, wire::SetTriangle>) {
      addTriangle(client, m);
    } else if (isWhole(m, broken)) {
      add({client, toCommand(m)});
      bytes_ += bytesOf(m);
    }
  };
  const auto decoded = wire::dispatchScene(message.kind, message.payload, handle);
  if (decoded && broken.empty()) return Outcome::taken;
  error = decoded ? broken : decoded.error();
  return Outcome::malformed;
}

void CommandDecoder::add(SceneTask&& task) {
  tasks_.push_back(std::move(task));
  bytes_ += sizeof(SceneTask);
}

void CommandDecoder::addVertex(scene::ClientId client, const wire::SetVertex& vertex) {
  const geometry::Vec3f position(vertex.position[0], vertex.position[1], vertex.position[2]);
  bytes_ += sizeof position;
  if (auto* run = lastRun<scene::SetVertices>(tasks_, client, vertex.object);
      run != nullptr && continues(run->first, run->positions.size(), vertex.vertex)) {
    run->positions.push_back(position);
    return;
  }
  add({client, scene::SetVertices{vertex.object, vertex.vertex, {position}}});
}

void CommandDecoder::addTriangle(scene::ClientId client, const wire::SetTriangle& triangle) {
  const auto& v = triangle.vertices;
  const geometry::Triangle corners{corner(v[0]), corner(v[1]), corner(v[2])};
  bytes_ += sizeof corners;
  if (auto* run = lastRun<scene::SetTriangles>(tasks_, client, triangle.object);
      run != nullptr && run->makesMetres && continues(run->first, run->triangles.size(), triangle.triangle)) {
    run->triangles.push_back(corners);
    return;
  }
  add({client, scene::SetTriangles{triangle.object, triangle.triangle, {corners}}});
}

std::vector<SceneTask> CommandDecoder::release() {
  bytes_ = 0;
  return std::exchange(tasks_, {});
}

}  // namespace hapticd::server
