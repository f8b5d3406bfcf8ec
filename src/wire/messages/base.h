// Messages of every device (vrpn_BaseClass).
#pragma once

#include "wire/types.h"

namespace hapticd::wire {

/// Values of Text::severity.
inline constexpr std::uint32_t kTextNormal = 0;
inline constexpr std::uint32_t kTextWarning = 1;
inline constexpr std::uint32_t kTextError = 2;
/// The begin of the text about a device with a fault, which each client gets as it subscribes.
inline constexpr std::string_view kNoForceText = "the device gives no force";

struct Ping {
  static constexpr MessageInfo kInfo{"vrpn_Base ping_message",
                                     Direction::kToServer,
                                     Reliability::kReliable,
                                     Role::control,
                                     "Asks whether the device is alive.",
                                     Access::free,
                                     Order::overtaking};
  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

struct Pong {
  static constexpr MessageInfo kInfo{"vrpn_Base pong_message", Direction::kToClient, Reliability::kReliable,
                                     Role::report, "Answers a ping: the device is alive."};
  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

struct Text {
  static constexpr MessageInfo kInfo{
      "vrpn_Base text_message", Direction::kBoth, Reliability::kReliable, Role::control,
      "Carries a text for a person: severity 0 is normal, 1 a warning, 2 an error."};
  std::uint32_t severity = kTextNormal;
  std::uint32_t level = 0;
  TextBuffer<1024> text;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("severity", m.severity);
    v("level", m.level);
    v("text", m.text);
  }
};

}  // namespace hapticd::wire
