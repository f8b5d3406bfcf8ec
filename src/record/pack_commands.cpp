#include "record/pack_commands.h"

#include "record/fields.h"

namespace hapticd::record {
namespace {

constexpr std::uint16_t kClientGone = 0;

template <class C>
constexpr CommandEntry<C> entryOf() {
  CommandEntry<C> found{};
  std::apply(
      [&](const auto&... entry) {
        const auto look = [&]<class E>(const E& e) {
          if constexpr (std::same_as<E, CommandEntry<C>>) found = e;
        };
        (look(entry), ...);
      },
      kCommands);
  return found;
}

// False when no command has this number.
bool takeCommand(std::uint16_t number, Unpacker& in, scene::SceneCommand& command) {
  bool known = false;
  std::apply(
      [&](const auto&... entry) {
        const auto look = [&]<class C>(const CommandEntry<C>& e) {
          if (e.number != number) return;
          known = true;
          in.take(command.emplace<C>());
        };
        (look(entry), ...);
      },
      kCommands);
  return known;
}

}  // namespace

void packSceneEvent(Bytes& out, std::uint32_t scene, scene::ClientId client, Nanos time,
                    const scene::SceneCommand* command) {
  Packer pack(out);
  pack.put(scene);
  pack.put(client);
  pack.put(time);
  if (command == nullptr) {
    pack.put(kClientGone);
    return;
  }
  std::visit(
      [&]<class C>(const C& c) {
        pack.put(entryOf<C>().number);
        pack.put(c);
      },
      *command);
}

bool unpackSceneEvent(ByteView bytes, SceneEvent& event, std::string& error) {
  Unpacker in(bytes);
  event = SceneEvent();
  in.take(event.scene);
  in.take(event.client);
  in.take(event.time);
  const auto number = in.next<std::uint16_t>();
  if (in.ok() && number != kClientGone && !takeCommand(number, in, event.command.emplace())) {
    error = "a scene command of number " + std::to_string(number) + ", which this version does not know";
    return false;
  }
  if (in.ok() && in.rest().empty()) return true;
  error = in.ok() ? "a scene event that is longer than it should be" : "a scene event that is cut short";
  return false;
}

const char* nameOf(const scene::SceneCommand& command) {
  return std::visit([]<class C>(const C&) { return entryOf<C>().name; }, command);
}

}  // namespace hapticd::record
