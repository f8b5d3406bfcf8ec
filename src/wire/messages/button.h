// Messages of vrpn_Button.
#pragma once

#include "wire/types.h"

namespace hapticd::wire {

/// ButtonAdmin::button that means every button.
inline constexpr std::int32_t kAllButtons = -99;
/// Values of ButtonAdmin::event and ButtonAlert::event.
inline constexpr std::int32_t kButtonMomentary = 10;
inline constexpr std::int32_t kButtonToggleOff = 20;
inline constexpr std::int32_t kButtonToggleOn = 21;

struct ButtonChange {
  static constexpr MessageInfo kInfo{"vrpn_Button Change", Direction::kToClient, Reliability::kReliable,
                                     Role::report, "Reports that a button went down (1) or up (0)."};
  std::int32_t button = 0;
  std::int32_t state = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("button", m.button);
    v("state", m.state);
  }
};

struct ButtonStates {
  static constexpr MessageInfo kInfo{
      "vrpn_Button States", Direction::kToClient, Reliability::kReliable, Role::report,
      "Reports the state of every button, on each new connection and for each ping."};
  Counted<std::int32_t, std::int32_t, 256> states;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("states", m.states);
  }
};

struct ButtonAdmin {
  static constexpr MessageInfo kInfo{
      "vrpn_Button Admin",
      Direction::kToServer,
      Reliability::kReliable,
      Role::control,
      "Makes a button (-99: all) momentary (10), a toggle that starts off (20) or one that starts on (21); "
      "the time stamp is that of the client's start.",
      Access::command};
  std::int32_t button = 0;
  std::int32_t event = kButtonMomentary;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("button", m.button);
    v("event", m.event);
  }
};

struct ButtonAlert {
  static constexpr MessageInfo kInfo{
      "vrpn_Button Alert", Direction::kToClient, Reliability::kReliable, Role::report,
      "Reports that a button's toggle was switched off (20, also for momentary) or on (21)."};
  std::int32_t button = 0;
  std::int32_t event = kButtonToggleOff;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("button", m.button);
    v("event", m.event);
  }
};

}  // namespace hapticd::wire
