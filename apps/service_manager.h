// What systemd learns from the server (sd_notify), without its library.
#pragma once

#include <string_view>

namespace hapticd::apps {

/// Sends a state such as "READY=1" to $NOTIFY_SOCKET; does nothing without one. Never blocks.
void notifyServiceManager(std::string_view state) noexcept;

}  // namespace hapticd::apps
