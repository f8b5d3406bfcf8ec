// Helpers of tests in which both sides of VRPN are in one program.
#pragma once

#include <vrpn_Connection.h>

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

namespace hapticd::test {

struct Release {
  void operator()(vrpn_Connection* connection) const { connection->removeReference(); }
};
using ServedConnection = std::unique_ptr<vrpn_Connection, Release>;

// Keeps payloads as they arrive.
struct Arrived {
  static int VRPN_CALLBACK keep(void* list, vrpn_HANDLERPARAM p) {
    static_cast<std::vector<std::string>*>(list)->emplace_back(p.buffer,
                                                               static_cast<std::size_t>(p.payload_len));
    return 0;
  }
};
using Payloads = std::vector<std::string>;

inline std::string ofNumbers(std::initializer_list<std::uint32_t> numbers) {
  std::string bytes;
  for (const std::uint32_t number : numbers) {
    for (const int shift : {24, 16, 8, 0}) bytes += static_cast<char>(number >> shift);
  }
  return bytes;
}

// As if its last client were gone, or another had come.
inline void tellOf(vrpn_Connection& connection, const char* what) {
  connection.pack_message(0, {}, connection.register_message_type(what),
                          connection.register_sender(vrpn_CONTROL), nullptr, vrpn_CONNECTION_RELIABLE);
}

}  // namespace hapticd::test
