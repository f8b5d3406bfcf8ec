#include "scene/commands.h"

namespace hapticd::scene {

SceneCommand::SceneCommand() = default;
SceneCommand::SceneCommand(const SceneCommand& other) = default;
SceneCommand::SceneCommand(SceneCommand&& other) noexcept = default;
SceneCommand& SceneCommand::operator=(const SceneCommand& other) = default;
SceneCommand& SceneCommand::operator=(SceneCommand&& other) noexcept = default;
SceneCommand::~SceneCommand() = default;

Target targetOf(const SceneCommand& command) {
  return std::visit([]<class C>(const C&) { return C::kInfo.target; }, command);
}

std::size_t bytesOf(const SceneCommand& command) {
  std::size_t bytes = sizeof(SceneCommand);
  if (const auto* run = std::get_if<SetVertices>(&command)) bytes += run->positions.size() * sizeof(Vec3f);
  if (const auto* run = std::get_if<SetTriangles>(&command))
    bytes += run->triangles.size() * sizeof(Triangle);
  if (const auto* effect = std::get_if<StartCustomEffect>(&command)) bytes += effect->parameters.size() * 4;
  return bytes;
}

}  // namespace hapticd::scene
