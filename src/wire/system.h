// System messages: negative types with which two peers describe themselves. The sender field carries an
// argument.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "wire/bytes.h"
#include "wire/result.h"

namespace hapticd::wire {

inline constexpr std::int32_t kSenderDescription = -1;  ///< sender field: the number described
inline constexpr std::int32_t kTypeDescription = -2;    ///< sender field: the number described
inline constexpr std::int32_t kUdpDescription = -3;     ///< sender field: UDP port
inline constexpr std::int32_t kLogDescription = -4;     ///< sender field: log mode
/// This type and lower ones end the connection; other unknown system messages are ignored.
inline constexpr std::int32_t kFirstForbiddenType = -2000;
/// Longest payload of a sender or type description.
inline constexpr std::size_t kMaxDescriptionBytes = 100;

/// The destination of datagrams.
struct UdpAddress {
  std::string host;  ///< letters, digits and dots only
  std::uint16_t port = 0;
};

/// Log files a client asks its server to write.
struct LogRequest {
  int mode = 0;  ///< bit 0 messages the server receives, bit 1 messages it sends
  std::string inName;
  std::string outName;
};

/// The name in the payload of a sender or type description, in place.
Result<std::string_view> decodeDescription(ByteView payload);
std::vector<std::byte> encodeDescription(std::string_view name);

/// The address in a UDP description, of which port is the sender field.
Result<UdpAddress> decodeUdpDescription(std::int32_t port, ByteView payload);
std::vector<std::byte> encodeUdpDescription(const UdpAddress& address);

/// The request in a log description, of which mode is the sender field.
Result<LogRequest> decodeLogDescription(std::int32_t mode, ByteView payload);
std::vector<std::byte> encodeLogDescription(const LogRequest& request);

}  // namespace hapticd::wire
