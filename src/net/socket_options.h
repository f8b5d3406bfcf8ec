// What only the operating system's own calls can set and tell about a socket; a port to another system
// rewrites this file, and sendmmsg, eventfd and the resolver beside it.
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>

#include "net/loss_watch.h"

namespace hapticd::net {

/// Keeps a child process (an isolated device) from holding the socket open.
void setCloseOnExec(int fd) noexcept;
/// Sends small packets at once.
void setNoDelay(int fd) noexcept;
/// Size of the system's send buffer.
void setSendBuffer(int fd, int bytes) noexcept;
/// How often a silent peer is probed; zero: never.
void setKeepAlive(int fd, std::chrono::seconds interval) noexcept;
/// What LossWatch wants to know; nothing when the socket is closed.
std::optional<LinkState> linkState(int fd) noexcept;
/// Bytes handed to the system that the peer has not acknowledged.
std::size_t unacknowledgedBytes(int fd) noexcept;

}  // namespace hapticd::net
