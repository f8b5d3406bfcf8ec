// What message structs are made of: time stamps, field types and the description every message carries.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace hapticd::wire {

/// Time stamp of a message as VRPN sends it: a timeval since the epoch.
struct Time {
  std::uint32_t seconds = 0;
  std::uint32_t microseconds = 0;
  friend bool operator==(const Time&, const Time&) = default;
};

/// Which side sends a message.
enum class Direction : std::uint8_t { kToServer, kToClient, kBoth };

/// How a message travels: reliable ones by TCP, low-latency ones by UDP once the connection has a UDP link.
enum class Reliability : std::uint8_t { kReliable, kLowLatency };

/// What a message is to the server.
enum class Role : std::uint8_t {
  unknown,  ///< not in the table: only of kUnknownKind
  control,  ///< addresses the server, the device or the connection: stop, heartbeat, subscription, question
  scene,    ///< changes the scene, in the order in which the client sent it
  report    ///< from server to client
};

/// Who may send a message to the server.
enum class Access : std::uint8_t {
  free,     ///< every client: it changes nothing that others feel
  operate,  ///< operators and owners: it re-arms, or moves the simulated hand
  command   ///< owners in control of the device: it changes what others feel
};

/// When the server handles a control message.
enum class Order : std::uint8_t {
  sequential,  ///< after everything that the same client sent before it
  overtaking   ///< as soon as it arrived, before scene commands of the same client that still wait
};

/// The fixed part of a message's description; the fields describe themselves through its fields().
struct MessageInfo {
  std::string_view name;  ///< exact name on the wire
  Direction direction;
  Reliability reliability;
  Role role;
  std::string_view meaning;  ///< one sentence
  Access access = role == Role::scene ? Access::command : Access::free;
  Order order = Order::sequential;
};

using F32x3 = std::array<float, 3>;
using F64x3 = std::array<double, 3>;
using F64x4 = std::array<double, 4>;  ///< quaternion x y z w
using F64x16 = std::array<double, 16>;

/// VRPN's vrpn_bool: two bytes, zero is false.
using Bool16 = std::int16_t;

/// Characters in a buffer of N bytes, cut at the first NUL (what lies behind it is the sender's stray
/// memory) or full without one.
template <std::size_t N>
struct NameBuffer {
  static constexpr std::size_t kMost = N;  ///< bytes of text
  std::array<char, N> bytes{};             ///< zero behind the text

  constexpr NameBuffer() = default;
  /// Longer text is cut to N bytes.
  constexpr NameBuffer(std::string_view text) {
    text = text.substr(0, std::min(text.find('\0'), N));
    std::copy(text.begin(), text.end(), bytes.begin());
  }
  constexpr NameBuffer(const char* text) : NameBuffer(std::string_view(text)) {}
  constexpr std::string_view view() const noexcept {
    const std::string_view all(bytes.data(), N);
    return all.substr(0, all.find('\0'));
  }
};

/// Text that always fills N bytes on the wire: cut to N-1 bytes, then NUL and zeros.
template <std::size_t N>
struct TextBuffer {
  static constexpr std::size_t kMost = N - 1;  ///< bytes of text
  std::string text;

  TextBuffer() = default;
  TextBuffer(std::string content) : text(std::move(content)) {}
  TextBuffer(const char* content) : text(content) {}
};

/// A list with its length in front, as the last field of a message; at most Max values either way.
template <class Count, class T, std::size_t Max>
struct Counted {
  static constexpr std::size_t kMax = Max;
  std::vector<T> values;
};

}  // namespace hapticd::wire
