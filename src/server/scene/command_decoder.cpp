#include "server/scene/command_decoder.h"

#include <algorithm>

#include "wire/dispatch.h"

namespace hapticd::server {
namespace {

// Members of a message to members of a command: other types, the same values.
template <class To, class From>
void convert(const From& from, To& to) {
  to = static_cast<To>(from);
}
template <class From>
void convert(const From& from, bool& to) {
  to = from != 0;
}
template <std::size_t N>
void convert(const wire::NameBuffer<N>& from, std::string& to) {
  to = from.view();
}
template <class From, std::size_t N, class To>
void convert(const std::array<From, N>& from, std::array<To, N>& to) {
  std::copy(from.begin(), from.end(), to.begin());
}
template <class From>
void convert(const std::array<From, 3>& from, geometry::Vec3& to) {
  to = geometry::Vec3(from[0], from[1], from[2]);
}

// The position in SceneCommand of the command that names this message; kNone when there is none.
constexpr std::size_t kNone = std::variant_size_v<scene::CommandVariant>;
constexpr std::size_t commandOf(std::string_view message) {
  std::size_t found = kNone;
  std::size_t next = 0;
  scene::forEachCommand([&]<class C>() {
    if (C::kInfo.message == message) found = next;
    ++next;
  });
  return found;
}

// A message that some command names in its kInfo: they have the same members, in the same order.
template <class M>
concept SameMembers = commandOf(M::kInfo.name)
!= kNone;

template <SameMembers M>
scene::SceneCommand toCommand(const M& message) {
  using Command = std::variant_alternative_t<commandOf(M::kInfo.name), scene::CommandVariant>;
  constexpr std::size_t kMembers = Command::kInfo.fields.size();
  Command command;
  scene::withMembers<kMembers>(message, [&](const auto&... from) {
    scene::withMembers<kMembers>(command, [&](auto&... to) { (convert(from, to), ...); });
  });
  return command;
}

// Messages whose members differ from those of their command.
geometry::Vec3 vec3(const wire::F32x3& v) {
  return {v[0], v[1], v[2]};
}
scene::SceneCommand toCommand(const wire::ResetScene&) {
  return scene::ResetScene{};
}
scene::SceneCommand toCommand(const wire::SetNormal& m) {
  return scene::SetNormal{m.object};
}
scene::SceneCommand toCommand(const wire::Plane& m) {
  scene::SetPlane command{.index = m.index,
                          .plane = {},
                          .stiffness = m.stiffness,
                          .damping = m.damping,
                          .staticFriction = m.staticFriction,
                          .dynamicFriction = m.dynamicFriction,
                          .recoveryCycles = m.recoveryCycles};
  convert(m.plane, command.plane);
  return command;
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
scene::SceneCommand toCommand(const wire::CustomEffect& m) {
  if (m.effect == wire::kStopCustomEffect) return scene::StopCustomEffect{};
  return scene::StartCustomEffect{m.effect, m.parameters.values};
}
scene::SceneCommand toCommand(const wire::MeshVertices& m) {
  scene::SetVertices run{m.object, m.first, {}};
  const std::vector<float>& numbers = m.positions.values;
  run.positions.reserve(numbers.size() / 3);
  for (std::size_t i = 0; i + 2 < numbers.size(); i += 3)
    run.positions.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
  return run;
}

// A negative vertex number becomes one that no mesh has, so that the scene refuses it, and prints it, by its
// number.
std::uint32_t corner(std::int32_t vertex) {
  return static_cast<std::uint32_t>(vertex);
}

scene::SceneCommand toCommand(const wire::MeshTriangles& m) {
  scene::SetTriangles run{m.object, m.first, {}, false};
  const std::vector<std::int32_t>& numbers = m.vertices.values;
  run.triangles.reserve(numbers.size() / 3);
  for (std::size_t i = 0; i + 2 < numbers.size(); i += 3)
    run.triangles.push_back({corner(numbers[i]), corner(numbers[i + 1]), corner(numbers[i + 2])});
  return run;
}

// Bytes of a bulk message in addition to its SceneTask.
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

// A bulk message holds triples.
template <class M>
bool isWhole(const M& message, std::string& error) {
  std::size_t numbers = 0;
  if constexpr (std::is_same_v<M, wire::MeshVertices>) numbers = message.positions.values.size();
  if constexpr (std::is_same_v<M, wire::MeshTriangles>) numbers = message.vertices.values.size();
  if (numbers % 3 == 0) return true;
  error = std::string(M::kInfo.name) + ": a list of " + std::to_string(numbers) +
          " numbers, not a multiple of three";
  return false;
}

// The last task, when it is a run of this client for this object.
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
