// Socket options and queries that need the operating system's own calls. A port to another system rewrites
// this file, and also sendmmsg, eventfd and the resolver.
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
/// Bytes that the system takes before it has sent them.
void setUnsentLimit(int fd, int bytes) noexcept;
/// How often a silent peer is probed; zero: never.
void setKeepAlive(int fd, std::chrono::seconds interval) noexcept;
/// Input of LossWatch; nothing when the socket is closed.
std::optional<LinkState> linkState(int fd) noexcept;
/// What a socket knows of its peer's end without reading.
enum class PeerEnd { none, closed, reset };
/// Sees an end also behind unread bytes; consumes neither bytes nor the pending error.
PeerEnd peerEnd(int fd) noexcept;
/// Of a listening socket: a connection waits.
bool isReadable(int fd) noexcept;
/// Lets the system take in as much as its limits allow (half of tcp_rmem's maximum) while nobody reads, so
/// that the end of the peer can arrive. Otherwise the receive buffer grows only with reading.
void widenReceiveBuffer(int fd) noexcept;
/// Bytes handed to the system that the peer has not acknowledged.
std::size_t unacknowledgedBytes(int fd) noexcept;

}  // namespace hapticd::net
