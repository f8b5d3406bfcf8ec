// Unix sockets of the operating system.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace hapticd::net {

/// A socket that listens at this path, see LocalListener. Throws Error.
int listenAt(const std::filesystem::path& path);
/// A socket that is connected to the one that listens there. Throws Error.
int connectTo(const std::filesystem::path& path);
/// The user at the other end of a Unix socket; nothing for other descriptors.
std::optional<std::uint32_t> userBehind(int fd) noexcept;
/// Of a file or folder, not of what a link leads to; nothing when there is none.
std::optional<std::uint32_t> ownerOf(const std::filesystem::path& path);

}  // namespace hapticd::net
