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

}  // namespace hapticd::scene
