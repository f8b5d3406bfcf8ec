#include "wire/system.h"

#include "wire/text.h"

namespace hapticd::wire {

namespace {

void put(std::vector<std::byte>& out, std::int32_t number) {
  out.resize(out.size() + sizeof(number));
  storeBig(out.data() + out.size() - sizeof(number), number);
}

void putWithNul(std::vector<std::byte>& out, std::string_view text) {
  const ByteView bytes = asBytes(text);
  out.insert(out.end(), bytes.begin(), bytes.end());
  out.push_back(std::byte{0});
}

}  // namespace

Result<std::string_view> decodeDescription(ByteView payload) {
  constexpr std::size_t kPrefix = sizeof(std::int32_t);
  if (payload.size() <= kPrefix || payload.size() > kMaxDescriptionBytes) {
    return Error{"description of " + std::to_string(payload.size()) + " bytes, expected 5 to " +
                 std::to_string(kMaxDescriptionBytes)};
  }
  const auto length = loadBig<std::int32_t>(payload.data());
  if (length < 1 || static_cast<std::size_t>(length) > payload.size() - kPrefix) {
    return Error{"description says its name has " + std::to_string(length) + " bytes, it has " +
                 std::to_string(payload.size() - kPrefix)};
  }
  // The length counts a NUL; the name ends there even when the sender forgot it.
  const std::string_view name = asText(payload.subspan(kPrefix, static_cast<std::size_t>(length) - 1));
  return name.substr(0, name.find('\0'));
}

std::vector<std::byte> encodeDescription(std::string_view name) {
  std::vector<std::byte> out;
  put(out, static_cast<std::int32_t>(name.size() + 1));
  putWithNul(out, name);
  return out;
}

Result<UdpAddress> decodeUdpDescription(std::int32_t port, ByteView payload) {
  std::string_view host = asText(payload);
  host = host.substr(0, host.find('\0'));
  if (!isHost(host)) {
    return Error{"UDP description: host " + inQuotes(host.substr(0, 255)) +
                 " is not letters, digits and dots"};
  }
  if (port < 1 || port > 65535) {
    return Error{"UDP description: port " + std::to_string(port) + " is not 1 to 65535"};
  }
  return UdpAddress{std::string(host), static_cast<std::uint16_t>(port)};
}

std::vector<std::byte> encodeUdpDescription(const UdpAddress& address) {
  std::vector<std::byte> out;
  putWithNul(out, address.host);
  return out;
}

Result<LogRequest> decodeLogDescription(std::int32_t mode, ByteView payload) {
  constexpr std::size_t kPrefix = 2 * sizeof(std::int32_t);
  if (payload.size() < kPrefix + 2) {
    return Error{"log description of " + std::to_string(payload.size()) + " bytes, expected at least 10"};
  }
  const std::int64_t in = loadBig<std::int32_t>(payload.data());
  const std::int64_t out = loadBig<std::int32_t>(payload.data() + sizeof(std::int32_t));
  if (in < 0 || out < 0 || static_cast<std::int64_t>(kPrefix) + in + 1 + out + 1 > std::ssize(payload)) {
    return Error{"log description of " + std::to_string(payload.size()) + " bytes cannot hold names of " +
                 std::to_string(in) + " and " + std::to_string(out)};
  }
  const std::string_view names = asText(payload.subspan(kPrefix));
  return LogRequest{
      mode & 3, std::string(names.substr(0, static_cast<std::size_t>(in))),
      std::string(names.substr(static_cast<std::size_t>(in) + 1, static_cast<std::size_t>(out)))};
}

std::vector<std::byte> encodeLogDescription(const LogRequest& request) {
  std::vector<std::byte> out;
  put(out, static_cast<std::int32_t>(request.inName.size()));
  put(out, static_cast<std::int32_t>(request.outName.size()));
  putWithNul(out, request.inName);
  putWithNul(out, request.outName);
  return out;
}

}  // namespace hapticd::wire
