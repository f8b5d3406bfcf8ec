// The client program of vrpn_user.h against what the same program said, and was told, when it was linked with
// VRPN 07.38.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <vrpn_Connection.h>

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "client/vrpn_stream.h"
#include "client/vrpn_user.h"
#include "net/loopback.h"

namespace hapticd {
namespace {

using net::RawSocket;
using test::VrpnMessage;
using test::VrpnStream;

// VRPN turns a constraint by products of rotations, which leave some 1e-14 N/m where zero is meant.
std::vector<VrpnMessage> withoutNoise(std::vector<VrpnMessage> said) {
  for (VrpnMessage& s : said) {
    if (s.type != "vrpn_ForceDevice Force_Field") continue;
    for (std::size_t at = 0; at + 4 <= s.payload.size(); at += 4) {
      const auto exponent = static_cast<unsigned char>(s.payload[at]) & 0x7F;  // all but its lowest bit
      if (exponent < 0x30) s.payload.replace(at, 4, 4, '\0');                  // below 2^-31
    }
  }
  return said;
}

constexpr auto kUserPatience = std::chrono::seconds(30);

TEST(VrpnUser, SaysToARecordedDeviceWhatVrpnDoesAndIsToldTheSame) {
  const std::string script = test::recording("vrpn_server/server.bin");
  VrpnStream expected;
  expected.feed(test::recording("vrpn_server/client.bin"));
  ASSERT_GT(expected.said().size(), 40U);

  RawSocket listener;
  const net::Endpoint address = listener.bindToAnyPort();
  ASSERT_EQ(::listen(listener.fd(), 1), 0);
  VrpnStream heard;
  std::thread device([&] {
    RawSocket socket = RawSocket::accepted(listener);
    socket.send(std::string_view(script).substr(0, test::kVrpnCookieBytes));
    bool told = false;
    for (std::string bytes; !(bytes = socket.receiveSome()).empty();) {
      heard.feed(bytes);
      if (told || heard.said().size() < expected.said().size()) continue;
      socket.send(std::string_view(script).substr(test::kVrpnCookieBytes));
      told = true;
    }
  });
  std::string seen;
  {
    vrpn_Connection* const connection =
        vrpn_get_connection_by_name(("Device0@tcp://127.0.0.1:" + std::to_string(address.port)).c_str());
    {
      DeviceUser user(connection);
      const auto end = std::chrono::steady_clock::now() + kUserPatience;
      const auto run = [&](const auto& condition) {
        while (!condition() && std::chrono::steady_clock::now() < end) user.mainloop();
      };
      run([&] { return connection->connected() != 0; });
      user.act();
      run([&] { return user.done(); });
      seen = user.seen();
    }
    connection->removeReference();
  }
  device.join();
  expectSame(withoutNoise(heard.said()), withoutNoise(expected.said()));
  EXPECT_EQ(seen, test::recording("vrpn_server/seen.txt"));
}

}  // namespace
}  // namespace hapticd
