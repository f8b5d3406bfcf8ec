// What describes a scene command beside its members: the decoder, the builder, recordings, exports and the
// tables in docs/recording-format.md are derived from it.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <type_traits>

namespace hapticd::scene {

/// The component of the builder that executes a command.
enum class Target { scene, objects, forces };

/// For CommandInfo::message: no message has the same members.
inline constexpr std::string_view kNoMessage;

/// The description of a command with N members.
template <std::size_t N>
struct CommandInfo {
  template <class... Fields>
  constexpr CommandInfo(const char* commandName, std::string_view wireMessage, Target executedBy,
                        Fields... names)
      : name(commandName), message(wireMessage), target(executedBy), fields{names...} {}

  const char* name;
  /// The wire name of the message whose members, in their order, are those of the command; units may differ
  /// in type only. kNoMessage where the decoder converts by hand.
  std::string_view message;
  Target target;
  std::array<const char*, N> fields;  ///< names of the members, in their order
};
template <class... Fields>
CommandInfo(const char*, std::string_view, Target, Fields...) -> CommandInfo<sizeof...(Fields)>;

/// Calls f with references to the N members of an aggregate, in their order. Another number of members does
/// not compile.
template <std::size_t N, class T, class F>
constexpr decltype(auto) withMembers(T& value, F&& f) {
  static_assert(N <= 8, "add a case for more members");
  if constexpr (N == 0) {
    static_assert(std::is_empty_v<T>);
    return f();
  } else if constexpr (N == 1) {
    auto& [a] = value;
    return f(a);
  } else if constexpr (N == 2) {
    auto& [a, b] = value;
    return f(a, b);
  } else if constexpr (N == 3) {
    auto& [a, b, c] = value;
    return f(a, b, c);
  } else if constexpr (N == 4) {
    auto& [a, b, c, d] = value;
    return f(a, b, c, d);
  } else if constexpr (N == 5) {
    auto& [a, b, c, d, e] = value;
    return f(a, b, c, d, e);
  } else if constexpr (N == 6) {
    auto& [a, b, c, d, e, g] = value;
    return f(a, b, c, d, e, g);
  } else if constexpr (N == 7) {
    auto& [a, b, c, d, e, g, h] = value;
    return f(a, b, c, d, e, g, h);
  } else {
    auto& [a, b, c, d, e, g, h, i] = value;
    return f(a, b, c, d, e, g, h, i);
  }
}

/// A struct that describes itself by a kInfo as above.
template <class C>
concept Described = requires {
  std::remove_const_t<C>::kInfo.fields.size();
};

/// Calls `visit(name, value)` for each member, in their order.
template <Described C, class Visit>
constexpr void fields(C& command, Visit&& visit) {
  constexpr const auto& info = std::remove_const_t<C>::kInfo;
  withMembers<info.fields.size()>(command, [&](auto&... member) {
    [[maybe_unused]] std::size_t i = 0;
    (visit(info.fields[i++], member), ...);
  });
}

}  // namespace hapticd::scene
