#include "net/endpoint.h"

#include <gtest/gtest.h>

namespace hapticd::net {
namespace {

std::string errorFor(const std::string& text) {
  try {
    (void)Endpoint::parse(text);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Endpoint, TextAndParseAreInverse) {
  const Endpoint endpoint{0xc0a80107, 3883};
  EXPECT_EQ(endpoint.text(), "192.168.1.7:3883");
  EXPECT_EQ(endpoint.addressText(), "192.168.1.7");
  EXPECT_EQ(Endpoint::parse("192.168.1.7:3883"), endpoint);
}

TEST(Endpoint, ParseTakesTheDefaultPort) {
  EXPECT_EQ(Endpoint::parse("127.0.0.1", 3883), (Endpoint{kLoopbackAddress, 3883}));
  EXPECT_EQ(Endpoint::parse("0.0.0.0:65535", 1), (Endpoint{kAnyAddress, 65535}));
}

TEST(Endpoint, ParseNamesTheOffendingText) {
  for (const char* text : {"", "localhost:1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1", "1.2.3:4",
                           "127.0.0.1:12x", ":3883", "127.0.0.1:1:2"}) {
    EXPECT_EQ(errorFor(text),
              "'" + std::string(text) + "' is not an IPv4 ADDRESS:PORT such as 127.0.0.1:3883");
  }
}

TEST(Resolve, FindsLocalhostAndNumbers) {
  EXPECT_EQ(resolve("127.0.0.1"), kLoopbackAddress);
  EXPECT_EQ(resolve("localhost") >> 24, 127u);
}

TEST(Resolve, NamesTheHostThatIsNotFound) {
  try {
    (void)resolve("no such host");
    FAIL() << "a name with spaces was resolved";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("cannot find host 'no such host': "), std::string::npos);
  }
}

TEST(LocalAddress, TowardsTheLoopbackIsTheLoopback) {
  EXPECT_EQ(localAddressTowards("127.0.0.1"), kLoopbackAddress);
}

}  // namespace
}  // namespace hapticd::net
