// Messages of vrpn_Analog.
#pragma once

#include "wire/types.h"

namespace hapticd::wire {

struct AnalogChannels {
  static constexpr MessageInfo kInfo{
      "vrpn_Analog Channel", Direction::kToClient, Reliability::kLowLatency, Role::report,
      "Reports the value of every channel; even their number travels as a float."};
  Counted<double, double, 128> channels;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("channels", m.channels);
  }
};

}  // namespace hapticd::wire
