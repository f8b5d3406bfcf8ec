// TLS around connections, client and server in one loop.
#include "tls/tls.h"

#include <gtest/gtest.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>

#include "base/fake_world.h"
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
    acceptor_.emplace(context_, loop_);
    listener_.emplace(loop_, net::Endpoint{net::kLoopbackAddress, 0},
                      [this, first](net::Connection accepted) {
                        server_.start(acceptor_->wrap(std::move(accepted)));
                        if (!first.empty()) server_.send(first);
                      });
    client_.start(wrap(client, net::Connection::connect(loop_, listener_->local(), 20s)));
  }
  bool until(const std::function<bool()>& done) {
    for (int i = 0; i < 2000 && !done(); ++i) loop_.runOnce(10ms);
    return done();
  }

  net::Loop loop_;
  Context context_ = Context::serverWithNewKey();
  std::optional<Acceptor> acceptor_;
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

// Signed by itself for the host lab7, valid from and until these seconds from now. Returns its file; the key
// is beside it.
fs::path certificateFor(long from_s, long until_s) {
  const fs::path file = fs::path(testing::TempDir()) / ("lab7-" + std::to_string(getpid()) + ".pem");
  EVP_PKEY* const key = EVP_EC_gen("P-256");
  X509* const certificate = X509_new();
  X509_gmtime_adj(X509_getm_notBefore(certificate), from_s);
  X509_gmtime_adj(X509_getm_notAfter(certificate), until_s);
  const auto* const name = reinterpret_cast<const unsigned char*>("lab7");
  X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate), "CN", MBSTRING_ASC, name, -1, -1, 0);
  X509_set_issuer_name(certificate, X509_get_subject_name(certificate));
  X509_set_pubkey(certificate, key);
  X509_sign(certificate, key, EVP_sha256());
  std::FILE* out = std::fopen(file.c_str(), "w");
  PEM_write_X509(out, certificate);
  std::fclose(out);
  out = std::fopen((file.string() + ".key").c_str(), "w");
  PEM_write_PrivateKey(out, key, nullptr, nullptr, 0, nullptr, nullptr);
  std::fclose(out);
  fs::permissions(file.string() + ".key", fs::perms::owner_read | fs::perms::owner_write);
  X509_free(certificate);
  EVP_PKEY_free(key);
  return file;
}

TEST_F(TlsTest, ACertificateThatIsRefusedIsSaidToBeWrongInWhat) {
  constexpr long kDay_s = 86'400;
  const auto endOf = [&](long from_s, long until_s, const std::string& host) {
    const fs::path file = certificateFor(from_s, until_s);
    context_ = Context::server(file, file.string() + ".key");
    client_ = {};
    server_ = {};
    connect(Context::clientThatTrusts(file, host));
    client_.send("hello");
    EXPECT_TRUE(until([&] { return client_.ended || server_.received == "hello"; }));
    fs::remove(file);
    fs::remove(file.string() + ".key");
    return client_.ended.value_or("");
  };
  const std::string failed = "TLS handshake failed: certificate verify failed: ";
  const std::string clock = ", or the clock of this machine is wrong";
  EXPECT_EQ(endOf(-kDay_s, kDay_s, "lab7"), "");
  EXPECT_EQ(endOf(-2 * kDay_s, -kDay_s, "lab7"), failed + "certificate has expired" + clock);
  EXPECT_EQ(endOf(kDay_s, 2 * kDay_s, "lab7"), failed + "certificate is not yet valid" + clock);
  EXPECT_EQ(endOf(-kDay_s, kDay_s, "lab8"), failed + "hostname mismatch");
}

TEST_F(TlsTest, AClientWithoutTlsIsRefused) {
  acceptor_.emplace(context_, loop_);
  listener_.emplace(loop_, net::Endpoint{net::kLoopbackAddress, 0}, [this](net::Connection accepted) {
    server_.start(acceptor_->wrap(std::move(accepted)));
  });
  client_.start(net::Connection::connect(loop_, listener_->local(), 20s));
  client_.send("vrpn: ver. 07.35  0");
  ASSERT_TRUE(until([&] { return server_.ended.has_value(); }));
  EXPECT_NE(server_.ended->find("TLS handshake failed"), std::string::npos) << *server_.ended;
  EXPECT_EQ(server_.received, "");
}

// Else strangers who ask for handshakes with a large key keep a stop waiting.
TEST_F(TlsTest, TheLoopOfAServerComputesNoHandshake) {
  const base::World& real = base::world();
  base::SimulatedClock clock;
  base::FakeThreads threads(clock);
  const base::ScopedWorld world({real.clock, threads, real.files, real.random});
  connect(Context::clientThatKnows(context_.fingerprint()));
  client_.send("early");
  ASSERT_TRUE(until([&] { return threads.nextDeadline().has_value(); })) << "a handshake is to be computed";
  for (int i = 0; i < 20; ++i) loop_.runOnce(1ms);
  EXPECT_EQ(server_.connection.statistics().bytesOut, 0U) << "nobody has computed it";
  const auto computed = [&](const auto& done) {
    return until([&] {
      threads.runDue();
      return done();
    });
  };
  ASSERT_TRUE(computed([&] { return server_.received == "early"; }));

  connect(Context::clientThatKnows(context_.fingerprint()));  // the old connections end
  ASSERT_TRUE(until([&] { return threads.nextDeadline().has_value(); }));
  server_ = {};
  threads.runDue();
  loop_.runOnce(0ms);  // its result finds nobody
  acceptor_.reset();
}

TEST_F(TlsTest, MoreThanBelongsToAHandshakeEndsTheConnection) {
  const base::World& real = base::world();
  base::SimulatedClock clock;
  base::FakeThreads threads(clock);
  const base::ScopedWorld world({real.clock, threads, real.files, real.random});
  acceptor_.emplace(context_, loop_);
  listener_.emplace(loop_, net::Endpoint{net::kLoopbackAddress, 0}, [this](net::Connection accepted) {
    server_.start(acceptor_->wrap(std::move(accepted)));
  });
  client_.start(net::Connection::connect(loop_, listener_->local(), 20s));
  for (int i = 0; i < 40; ++i) client_.send(std::string(100'000, 'x'));
  ASSERT_TRUE(until([&] { return server_.ended.has_value(); }));
  EXPECT_NE(server_.ended->find("more arrives than belongs to a TLS handshake"), std::string::npos);
  acceptor_.reset();
}

// A client that does with TLS what ours never does.
class HostileClient {
 public:
  explicit HostileClient(net::Connection stream) : stream_(std::move(stream)) {
    SSL_set_bio(ssl_.get(), BIO_new(BIO_s_mem()), BIO_new(BIO_s_mem()));
    SSL_set_connect_state(ssl_.get());
    stream_.start({.onConnected = [this] { step(); },
                   .onBytes =
                       [this](auto bytes) {
                         BIO_write(SSL_get_rbio(ssl_.get()), bytes.data(), static_cast<int>(bytes.size()));
                         step();
                       },
                   .onClosed = [](const std::string&) {}});
  }

  bool established() const { return SSL_is_init_finished(ssl_.get()) == 1; }
  void askForKeys(int times) {
    for (int i = 0; i < times; ++i) {
      SSL_key_update(ssl_.get(), SSL_KEY_UPDATE_REQUESTED);
      SSL_do_handshake(ssl_.get());
    }
    step();
  }
  void send(const std::string& text) {
    SSL_write(ssl_.get(), text.data(), static_cast<int>(text.size()));
    step();
  }

 private:
  void step() {
    SSL_do_handshake(ssl_.get());
    char ignored[64];
    while (established() && SSL_read(ssl_.get(), ignored, sizeof(ignored)) > 0) continue;
    net::Buffer out(BIO_ctrl_pending(SSL_get_wbio(ssl_.get())));
    if (!out.empty()) BIO_read(SSL_get_wbio(ssl_.get()), out.data(), static_cast<int>(out.size()));
    stream_.send(std::span<const std::byte>(out));
    stream_.flush();
  }

  std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> context_{SSL_CTX_new(TLS_client_method()), SSL_CTX_free};
  std::unique_ptr<SSL, decltype(&SSL_free)> ssl_{SSL_new(context_.get()), SSL_free};
  net::Connection stream_;
};

// Each answer to 27 bytes takes the loop 50 us.
TEST_F(TlsTest, OnlySoManyNewKeysAreMadeForAClient) {
  acceptor_.emplace(context_, loop_);
  listener_.emplace(loop_, net::Endpoint{net::kLoopbackAddress, 0}, [this](net::Connection accepted) {
    server_.start(acceptor_->wrap(std::move(accepted)));
  });
  HostileClient client(net::Connection::connect(loop_, listener_->local(), 20s));
  ASSERT_TRUE(until([&] { return client.established(); }));
  client.askForKeys(20);
  client.send("still here");
  EXPECT_TRUE(until([&] { return server_.received == "still here"; }));
  client.send(std::string(3'000'000, 'x'));
  client.askForKeys(14);
  client.send("and after 3 MB");
  EXPECT_TRUE(until([&] { return server_.received.ends_with("and after 3 MB"); }));
  EXPECT_FALSE(server_.ended);
  client.askForKeys(1000);
  ASSERT_TRUE(until([&] { return server_.ended.has_value(); }));
  EXPECT_EQ(*server_.ended, "the peer asks for new TLS keys again and again");
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

// Nobody is asked for a password: the server may have a terminal, and it starts without a person.
TEST_F(TlsTest, AKeyWithAPasswordIsRefusedWithoutAQuestion) {
  const fs::path certificate = certificateFor(0, 3600);
  const fs::path key = fs::path(testing::TempDir()) / ("secret-" + std::to_string(getpid()) + ".pem");
  const auto errorOf = [&] {
    try {
      Context::server(certificate, key);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string reason = "the file holds none in PEM, or one with a password";
  std::ofstream(key) << "no key";
  fs::permissions(key, fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_NE(errorOf().find(reason), std::string::npos) << errorOf();
  EVP_PKEY* const secret = EVP_EC_gen("P-256");
  std::FILE* const file = std::fopen(key.c_str(), "w");
  std::string password = "secret";
  PEM_write_PKCS8PrivateKey(file, secret, EVP_aes_256_cbc(), password.data(),
                            static_cast<int>(password.size()), nullptr, nullptr);
  std::fclose(file);
  EVP_PKEY_free(secret);
  EXPECT_NE(errorOf().find(reason), std::string::npos) << errorOf();
  fs::remove(key);
  fs::remove(certificate);
  fs::remove(certificate.string() + ".key");
}

}  // namespace
}  // namespace hapticd::tls
