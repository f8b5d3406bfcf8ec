// Between VRPN's callbacks and our message structs.
#pragma once

#include <algorithm>
#include <exception>
#include <vector>

#include "client/link.h"
#include "hapticd/vrpn/vrpn_Connection.h"
#include "wire/codec.h"

namespace hapticd::client {

/// Writes the payload of a message to a buffer that is large enough; returns its size.
template <wire::WireMessage M>
vrpn_int32 writePayload(const M& message, char* out) {
  wire::encodePayload(message, reinterpret_cast<std::byte*>(out));
  return static_cast<vrpn_int32>(wire::payloadSize(message));
}

/// Sends a message of a device, stamped with the present or the given time; prints errors, as VRPN does.
template <wire::WireMessage M>
void sendMessage(vrpn_Connection* connection, vrpn_int32 sender, const M& message,
                 wire::Reliability reliability = M::kInfo.reliability, const timeval* time = nullptr) {
  if (!connection || !connection->doing_okay()) return;
  std::vector<char> payload;
  try {
    if (connection->link() && !time) {
      connection->link()->send(wireNow(), {sender}, message, reliability);
      return;
    }
    payload.resize(wire::payloadSize(message));
    writePayload(message, payload.data());
  } catch (const std::exception& error) {  // of the network, or a message that is too long
    connection->printRefusal(error);
    return;
  }
  connection->pack_message(
      static_cast<vrpn_uint32>(payload.size()), time ? *time : connection->get_time(),
      wire::kLocalType<M>.value, sender, payload.data(),
      reliability == wire::Reliability::kReliable ? vrpn_CONNECTION_RELIABLE : vrpn_CONNECTION_LOW_LATENCY);
}

/// Calls use(message) with the decoded payload. Ignores a damaged one, where stock VRPN drops the connection.
template <wire::WireMessage M, class Use>
int receiveMessage(const vrpn_HANDLERPARAM& p, Use&& use) {
  const wire::ByteView payload(reinterpret_cast<const std::byte*>(p.buffer),
                               static_cast<std::size_t>(p.payload_len));
  const wire::Result<M> message = wire::decode<M>(payload);
  if (message) use(*message);
  return 0;
}

template <class T, std::size_t N>
void copyTo(T (&out)[N], const std::array<T, N>& in) {
  std::copy(in.begin(), in.end(), out);
}
template <std::size_t N, class T>
std::array<T, N> arrayOf(const T* in) {
  std::array<T, N> out{};
  std::copy(in, in + N, out.begin());
  return out;
}

}  // namespace hapticd::client
