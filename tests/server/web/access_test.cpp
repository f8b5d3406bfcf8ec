#include "server/web/access.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace hapticd::server {
namespace {

using testing::HasSubstr;
using Headers = std::vector<std::pair<std::string, std::string>>;

const net::Endpoint kLocal{net::kLoopbackAddress, 8080};

std::string refusal(const Headers& headers, const WebAccess& access = {kLocal, {}},
                    const net::Endpoint& reached = kLocal) {
  net::HttpRequest request;
  request.method = "GET";
  request.target = "/api/state";
  request.headers = headers;
  request.local = reached;
  return access.refusal(request);
}

TEST(WebAccess, AllowsLocalNames) {
  for (const char* host : {"localhost:8080", "LocalHost:8080", "127.0.0.1:8080", "[::1]:8080"}) {
    EXPECT_EQ(refusal({{"host", host}}), "") << host;
    EXPECT_EQ(refusal({{"host", host}, {"origin", std::string("http://") + host}}), "") << host;
  }
}

TEST(WebAccess, RefusesForeignHostNames) {
  for (const char* host : {"evil.example:8080", "localhost", "localhost:80", "localhost:8081", "127.0.0.1",
                           "localhost.evil.example:8080", "evil.example", "", "127.0.0.2:8080",
                           "localhost:8080@evil.example", "localhost:8080.evil.example", "0.0.0.0:8080"}) {
    EXPECT_THAT(refusal({{"host", host}}), HasSubstr("does not answer to the name")) << host;
  }
}

// Browsers leave out the port of the scheme.
TEST(WebAccess, NeedsNoPortWhereTheSchemeSaysIt) {
  const WebAccess encrypted({net::kLoopbackAddress, 443}, {"lab7"});
  for (const char* host : {"localhost", "127.0.0.1", "lab7", "lab7:443"}) {
    EXPECT_EQ(refusal({{"host", host}}, encrypted), "") << host;
    EXPECT_EQ(refusal({{"host", host}, {"origin", std::string("https://") + host}}, encrypted), "") << host;
  }
  EXPECT_NE(refusal({{"host", "localhost:80"}}, encrypted), "");
  EXPECT_NE(refusal({{"host", "evil.example"}}, encrypted), "");
  EXPECT_NE(refusal({{"host", "localhost"}, {"origin", "http://localhost"}}, encrypted), "");
}

TEST(WebAccess, RequiresExactlyOneHostHeader) {
  EXPECT_NE(refusal({}), "");
  EXPECT_NE(refusal({{"host", "localhost:8080"}, {"host", "evil.example"}}), "");
}

TEST(WebAccess, RefusesForeignOrigins) {
  for (const char* origin :
       {"http://evil.example", "https://evil.example", "null", "http://localhost", "http://localhost:3000",
        "http://localhost:8080.evil.example", "", "file://", "chrome-extension://abc", "localhost:8080"}) {
    EXPECT_THAT(refusal({{"host", "localhost:8080"}, {"origin", origin}}),
                HasSubstr("may not use this server"))
        << origin;
  }
  EXPECT_NE(refusal({{"host", "localhost:8080"},
                     {"origin", "http://localhost:8080"},
                     {"origin", "http://evil.example"}}),
            "");
}

TEST(WebAccess, RefusesCrossSiteEmbeddingButNotNavigation) {
  EXPECT_NE(
      refusal({{"host", "localhost:8080"}, {"sec-fetch-site", "cross-site"}, {"sec-fetch-mode", "no-cors"}}),
      "");
  EXPECT_EQ(
      refusal({{"host", "localhost:8080"}, {"sec-fetch-site", "cross-site"}, {"sec-fetch-mode", "navigate"}}),
      "");
  EXPECT_EQ(
      refusal({{"host", "localhost:8080"}, {"sec-fetch-site", "same-origin"}, {"sec-fetch-mode", "cors"}}),
      "");
}

TEST(WebAccess, AllowsTheAddressThatTheClientConnectedTo) {
  const WebAccess everywhere({net::kAnyAddress, 8080}, {});
  const net::Endpoint reached = net::Endpoint::parse("192.168.1.7:8080");
  EXPECT_EQ(refusal({{"host", "192.168.1.7:8080"}}, everywhere, reached), "");
  EXPECT_EQ(
      refusal({{"host", "192.168.1.7:8080"}, {"origin", "http://192.168.1.7:8080"}}, everywhere, reached),
      "");
  EXPECT_NE(refusal({{"host", "192.168.1.8:8080"}}, everywhere, reached), "");
  EXPECT_NE(refusal({{"host", "lab7:8080"}}, everywhere, reached), "");
  EXPECT_EQ(refusal({{"host", "192.168.1.7:8080"}}, {reached, {}}, reached), "");
}

TEST(WebAccess, AllowsConfiguredNames) {
  const WebAccess access(kLocal, {"Lab7", "proxy.example:443"});
  EXPECT_EQ(refusal({{"host", "lab7:8080"}, {"origin", "http://lab7:8080"}}, access), "");
  EXPECT_EQ(refusal({{"host", "localhost:8080"},
                     {"origin", "http://lab7:8080"},
                     {"sec-fetch-site", "cross-site"},
                     {"sec-fetch-mode", "cors"}},
                    access),
            "");
  EXPECT_NE(refusal({{"host", "lab7:8081"}}, access), "");
  EXPECT_EQ(refusal({{"host", "proxy.example:443"}}, access), "");
  EXPECT_EQ(refusal({{"host", "proxy.example:443"}, {"origin", "https://proxy.example"}}, access), "")
      << "443 is the default port of https";
  EXPECT_NE(refusal({{"host", "proxy.example"}, {"origin", "http://proxy.example"}}, access), "");
}

TEST(WebAccess, NamesNeedNoPortOnPort80) {
  const WebAccess access({net::kLoopbackAddress, 80}, {});
  EXPECT_EQ(refusal({{"host", "localhost"}, {"origin", "http://localhost"}}, access), "");
  EXPECT_NE(refusal({{"host", "localhost"}, {"origin", "https://localhost"}}, access), "");
}

TEST(WebAccess, QuotesAndTruncatesUntrustedText) {
  EXPECT_LT(refusal({{"host", std::string(5000, 'x')}}).size(), 300u);
  EXPECT_THAT(refusal({{"host", "a\x1b[31m"}}), HasSubstr("\\x1b"));
}

}  // namespace
}  // namespace hapticd::server
