// Unix sockets of the operating system.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>

namespace hapticd::net {

/// Bytes of the path of a Unix socket, at most.
inline constexpr std::size_t kLongestSocketPath = 107;

/// A socket that listens at this path, see LocalListener. Throws Error.
int listenAt(const std::filesystem::path& path);
/// A socket that is connected to the one that listens there. Throws Error.
int connectTo(const std::filesystem::path& path);
/// Whether a server left the socket at this path when it was killed. Throws Error.
bool isAbandoned(const std::filesystem::path& path);
/// The user at the other end of a Unix socket; nothing for other descriptors.
std::optional<std::uint32_t> userBehind(int fd) noexcept;
/// Of a file or folder, not of what a link leads to; nothing when there is none.
std::optional<std::uint32_t> ownerOf(const std::filesystem::path& path);

}  // namespace hapticd::net
