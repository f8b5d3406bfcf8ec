// TLS around connections, client and server in one loop.
#include "tls/tls.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "net/loop.h"
#include "net/tcp_listener.h"

namespace hapticd::tls {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

// One side: what it received, and how it ended.
struct Side {
  net::Connection connection;
  std::string received;
  std::optional<std::string> ended;

  void start(net::Connection made) {
    connection = std::move(made);
    connection.start({.onBytes =
                          [this](auto bytes) {
                            received.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
                          },
                      .onClosed = [this](const std::string& reason) { ended = reason; }});
  }
  void send(const std::string& text) {
    connection.send(std::as_bytes(std::span(text)));
    connection.flush();
  }
};

class TlsTest : public ::testing::Test {
 protected:
  void connect(const Context& client, const std::string& first = "") {
    listener_.emplace(loop_, net::Endpoint{net::kLoopbackAddress, 0},
                      [this, first](net::Connection accepted) {
                        server_.start(wrap(context_, std::move(accepted)));
                        if (!first.empty()) server_.send(first);
                      });
    client_.start(wrap(client, net::Connection::connect(loop_, listener_->local(), 20s)));
  }
  bool until(const std::function<bool()>& done) {
    for (int i = 0; i < 2000 && !done(); ++i) loop_.runOnce(10ms);
    return done();
  }

  net::Loop loop_;
  const Context context_ = Context::serverWithNewKey();
  std::optional<net::TcpListener> listener_;
  Side server_;
  Side client_;
};

TEST_F(TlsTest, CarriesBytesBothWaysAndTheServerMaySpeakFirst) {
  connect(Context::clientThatKnows(context_.fingerprint()), "hello");
  client_.send("early");
  ASSERT_TRUE(until([&] { return client_.received == "hello" && server_.received == "early"; }));
  const std::string big(3'000'000, 'x');
  client_.send(big);
  EXPECT_TRUE(until([&] { return server_.received.size() == big.size() + 5; }));
  client_.connection.close("done");
  EXPECT_TRUE(until([&] { return client_.ended && server_.ended; }));
}

TEST_F(TlsTest, NothingTravelsInClear) {
  std::string seen;
  net::TcpListener eavesdropper(loop_, {net::kLoopbackAddress, 0}, [&](net::Connection near) {
    server_.connection = std::move(near);
    server_.connection.start({.onBytes = [&](auto bytes) {
      seen.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    }});
  });
  client_.start(wrap(Context::clientThatKnows(context_.fingerprint()),
                     net::Connection::connect(loop_, eavesdropper.local(), 20s)));
  client_.send("a secret token");
  ASSERT_TRUE(until([&] { return seen.size() > 100; }));
  EXPECT_EQ(seen[0], '\x16') << "the hello of a TLS client";
  EXPECT_EQ(seen.find("secret"), std::string::npos);
}

TEST_F(TlsTest, AnotherCertificateEndsTheConnectionBeforeAnythingIsSent) {
  connect(Context::clientThatKnows(Context::serverWithNewKey().fingerprint()));
  client_.send("a secret token");
  ASSERT_TRUE(until([&] { return client_.ended.has_value(); }));
  EXPECT_NE(client_.ended->find("another certificate, with the fingerprint " + context_.fingerprint()),
            std::string::npos)
      << *client_.ended;
  EXPECT_EQ(server_.received, "");
}

TEST_F(TlsTest, AClientWithoutTlsIsRefused) {
  listener_.emplace(loop_, net::Endpoint{net::kLoopbackAddress, 0},
                    [this](net::Connection accepted) { server_.start(wrap(context_, std::move(accepted))); });
  client_.start(net::Connection::connect(loop_, listener_->local(), 20s));
  client_.send("vrpn: ver. 07.35  0");
  ASSERT_TRUE(until([&] { return server_.ended.has_value(); }));
  EXPECT_NE(server_.ended->find("TLS handshake failed"), std::string::npos) << *server_.ended;
  EXPECT_EQ(server_.received, "");
}

TEST_F(TlsTest, AnUnfinishedHandshakeHoldsABoundedAmount) {
  net::TcpListener silent(loop_, {net::kLoopbackAddress, 0},
                          [&](net::Connection near) { server_.connection = std::move(near); });
  client_.start(wrap(Context::clientThatKnows(context_.fingerprint()),
                     net::Connection::connect(loop_, silent.local(), 20s)));
  for (int i = 0; i < 40; ++i) client_.send(std::string(100'000, 'x'));
  ASSERT_TRUE(until([&] { return client_.ended.has_value(); }));
  EXPECT_NE(client_.ended->find("does not finish the TLS handshake"), std::string::npos);
}

TEST_F(TlsTest, KeysThatOthersMayReadAndWrongFilesAreRefused) {
  const fs::path key = fs::path(testing::TempDir()) / ("key-" + std::to_string(getpid()) + ".pem");
  const auto errorOf = [&] {
    try {
      Context::server("/nonexistent/cert.pem", key);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(errorOf().find("cannot read the key"), std::string::npos);
  std::ofstream(key) << "no key";
  fs::permissions(key, fs::perms::owner_read | fs::perms::others_read);
  EXPECT_NE(errorOf().find("chmod 0600"), std::string::npos);
  fs::permissions(key, fs::perms::owner_read);
  EXPECT_NE(errorOf().find("cannot use the certificate"), std::string::npos) << errorOf();
  fs::remove(key);
  EXPECT_THROW(Context::clientThatKnows("12:34"), Error);
}

}  // namespace
}  // namespace hapticd::tls
