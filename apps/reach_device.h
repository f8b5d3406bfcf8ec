// How a command that speaks the wire itself begins.
#pragma once

#include <chrono>

#include "client/link.h"

namespace hapticd::apps {

/// How long a server may take to answer.
inline constexpr std::chrono::seconds kAnswerTime{5};

/// Connects, and waits until the device answers. Throws ConnectError.
void reachDevice(client::Link& link, const client::DeviceAddress& address, wire::LocalSender device);

/// The same; `isHapticd`, which is used as long as the link polls, becomes true once a hapticd has answered.
void reachDevice(client::Link& link, const client::DeviceAddress& address, wire::LocalSender device,
                 bool& isHapticd);

}  // namespace hapticd::apps
