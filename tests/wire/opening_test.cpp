// What opens a connection: cookies and connection requests.
#include <gtest/gtest.h>

#include "wire/cookie.h"
#include "wire/recording.h"
#include "wire/text.h"
#include "wire/udp_request.h"

namespace hapticd::wire {
namespace {

using namespace std::string_literals;

TEST(Cookies, AnnounceOurVersion) {
  EXPECT_EQ(asText(encodeCookie(0)), "vrpn: ver. 07.38  0\0\0\0\0\0"s);
  EXPECT_EQ(asText(encodeCookie(3)), "vrpn: ver. 07.38  3\0\0\0\0\0"s);
}

TEST(Cookies, OfEveryMinorVersionAreAccepted) {
  const Result<Cookie> cookie = decodeCookie(ByteView(recorded("tcp.c2s.tcp.bin")).first(kCookieBytes));
  ASSERT_TRUE(cookie) << cookie.error();
  EXPECT_EQ(cookie->version, "07.34");
  EXPECT_EQ(cookie->log_mode, 0);
  EXPECT_EQ(decodeCookie(asBytes("vrpn: ver. 07.99  2\0\0\0\0\0"s))->log_mode, 2);
}

TEST(Cookies, OfAnotherMajorVersionAreQuoted) {
  const Result<Cookie> cookie = decodeCookie(asBytes("vrpn: ver. 06.38  0\0\0\0\0\0"s));
  ASSERT_FALSE(cookie);
  EXPECT_EQ(cookie.error(),
            R"(peer opened with "vrpn: ver. 06.38  0\x00\x00\x00\x00\x00", expected "vrpn: ver. 07.xx")");
  EXPECT_FALSE(decodeCookie(asBytes("GET / HTTP/1.1\r\nHost: me"s)));
}

TEST(Cookies, WithAnotherLogModeAreQuoted) {
  for (const char digit : {'/', '4', ' ', '\0', '\xff'}) {
    std::string text = "vrpn: ver. 07.38  0\0\0\0\0\0"s;
    text[18] = digit;
    EXPECT_FALSE(decodeCookie(asBytes(text))) << static_cast<int>(digit);
  }
  EXPECT_NE(
      decodeCookie(asBytes("vrpn: ver. 07.38  7\0\0\0\0\0"s)).error().find("log mode \"7\" is not 0 to 3"),
      std::string::npos);
}

TEST(ConnectionRequests, AreHostAndPort) {
  for (const std::string& text : {"192.168.1.20 1024\0"s, "pc7.lab 65535"s, "a 2000\0garbage"s}) {
    EXPECT_TRUE(parseUdpRequest(asBytes(text))) << text;
  }
  EXPECT_EQ(parseUdpRequest(asBytes("a 2000\0garbage"s))->port, 2000);
  EXPECT_EQ(formatUdpRequest({"127.0.0.1", 40000}), "127.0.0.1 40000\0"s);
}

TEST(ConnectionRequests, OfAnyOtherFormAreQuoted) {
  for (const std::string& text :
       {""s, "\0"s, "host"s, " 2000"s, "host 1023"s, "host 65536"s, "host -1"s, "host 99999999999999"s,
        "host 20x0"s, "host  2000"s, "ho/st 2000"s, "host;rm 2000"s, "ho\nst 2000"s, "h\xc3\xb6st 2000"s,
        "host 2000 3000"s, std::string(300, 'a') + " 2000"}) {
    const Result<UdpRequest> request = parseUdpRequest(asBytes(text));
    ASSERT_FALSE(request) << text;
    EXPECT_NE(request.error().find("connection request \""), std::string::npos);
  }
  EXPECT_EQ(parseUdpRequest(asBytes("host 80"s)).error(),
            "connection request \"host 80\": port \"80\" is not 1024 to 65535");
}

}  // namespace
}  // namespace hapticd::wire
