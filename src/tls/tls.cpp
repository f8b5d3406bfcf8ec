#include "tls/tls.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "net/connection_impl.h"

namespace hapticd::tls {
namespace {

template <auto Free>
struct Freeing {
  template <class T>
  void operator()(T* object) const noexcept {
    Free(object);
  }
};
using SslContext = std::unique_ptr<SSL_CTX, Freeing<SSL_CTX_free>>;
using Certificate = std::unique_ptr<X509, Freeing<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freeing<EVP_PKEY_free>>;

// The newest text of OpenSSL in this thread; clears the others.
std::string reason() {
  const unsigned long code = ERR_peek_last_error();
  const char* const text = code != 0 ? ERR_reason_error_string(code) : nullptr;
  ERR_clear_error();
  // So OpenSSL names the first bytes of any other protocol.
  if (ERR_GET_LIB(code) == ERR_LIB_SSL && ERR_GET_REASON(code) == SSL_R_WRONG_VERSION_NUMBER)
    return "the peer speaks no TLS";
  if (ERR_GET_REASON(code) == ERR_R_PEM_LIB) return "the file holds none in PEM, or one with a password";
  return text != nullptr ? text : "no reason given";
}

std::string fingerprintOf(const X509* certificate) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  if (certificate == nullptr || X509_digest(certificate, EVP_sha256(), digest.data(), &size) != 1) return "";
  constexpr char kDigits[] = "0123456789ABCDEF";
  std::string text;
  for (const unsigned char byte : std::span(digest).first(size)) {
    if (!text.empty()) text += ':';
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

std::string digitsOf(const std::string& fingerprint) {
  std::string digits;
  for (const char c : fingerprint) {
    if (c != ':') digits += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  return digits;
}

void requirePrivate(const std::string& file) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::perms mode = fs::status(file, error).permissions();
  if (error) throw KeyError("TLS: cannot read the key '" + file + "': " + error.message());
  if ((mode & (fs::perms::group_all | fs::perms::others_all)) != fs::perms::none)
    throw KeyError("TLS: others than its owner may use the key '" + file + "': chmod 0600 " + file);
}

// OpenSSL calls it for each message of TLS itself; `counter` counts the new keys that the peer asked for.
void noteMessage(int sent, int /*version*/, int type, const void* bytes, std::size_t size, SSL* /*ssl*/,
                 void* counter) {
  if (sent != 0 || type != SSL3_RT_HANDSHAKE || size == 0 || counter == nullptr) return;
  if (*static_cast<const unsigned char*>(bytes) == SSL3_MT_KEY_UPDATE) ++*static_cast<std::size_t*>(counter);
}

SslContext newContext(const SSL_METHOD* method) {
  SslContext context(SSL_CTX_new(method));
  if (!context || SSL_CTX_set_min_proto_version(context.get(), TLS1_3_VERSION) != 1)
    throw Error("TLS: this OpenSSL has no TLS 1.3: " + reason());
  SSL_CTX_set_num_tickets(context.get(), 0);  // sessions are long: nobody resumes one
  SSL_CTX_set_mode(context.get(), SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_RELEASE_BUFFERS);
  SSL_CTX_set_msg_callback(context.get(), noteMessage);
  return context;
}

Certificate selfSigned(EVP_PKEY* key) {
  constexpr long kYears_s = 10L * 365 * 24 * 3600;
  Certificate certificate(X509_new());
  X509_set_version(certificate.get(), 2);
  ASN1_INTEGER_set(X509_get_serialNumber(certificate.get()), 1);
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -3600);
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()), kYears_s);
  X509_set_pubkey(certificate.get(), key);
  X509_NAME* const name = X509_get_subject_name(certificate.get());
  X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC, reinterpret_cast<const unsigned char*>("hapticd"), -1,
                             -1, 0);
  X509_set_issuer_name(certificate.get(), name);
  if (X509_sign(certificate.get(), key, EVP_sha256()) == 0)
    throw Error("TLS: cannot make a certificate: " + reason());
  return certificate;
}

}  // namespace

class Context::Impl {
 public:
  explicit Impl(const SSL_METHOD* method) : context(newContext(method)) {}

  SslContext context;
  std::string fingerprint;
  bool isServer = false;
  std::string expected;  // digits of the fingerprint that a client knows; empty: it trusts authorities
  std::string host;
};

Context Context::server(const std::string& certificateFile, const std::string& keyFile) {
  auto impl = std::make_shared<Impl>(TLS_server_method());
  impl->isServer = true;
  SSL_CTX* const context = impl->context.get();
  requirePrivate(keyFile);
  // A server starts without a person: OpenSSL would ask on its terminal.
  SSL_CTX_set_default_passwd_cb(context, [](char*, int, int, void*) { return -1; });
  if (SSL_CTX_use_certificate_chain_file(context, certificateFile.c_str()) != 1)
    throw Error("TLS: cannot use the certificate '" + certificateFile + "': " + reason());
  if (SSL_CTX_use_PrivateKey_file(context, keyFile.c_str(), SSL_FILETYPE_PEM) != 1 ||
      SSL_CTX_check_private_key(context) != 1)
    throw KeyError("TLS: cannot use the key '" + keyFile + "' with '" + certificateFile + "': " + reason());
  impl->fingerprint = fingerprintOf(SSL_CTX_get0_certificate(context));
  return Context(std::move(impl));
}

Context Context::serverWithNewKey() {
  auto impl = std::make_shared<Impl>(TLS_server_method());
  impl->isServer = true;
  const Key key(EVP_EC_gen("P-256"));
  if (!key) throw Error("TLS: cannot make a key: " + reason());
  const Certificate certificate = selfSigned(key.get());
  if (SSL_CTX_use_certificate(impl->context.get(), certificate.get()) != 1 ||
      SSL_CTX_use_PrivateKey(impl->context.get(), key.get()) != 1)
    throw Error("TLS: cannot use a new key: " + reason());
  impl->fingerprint = fingerprintOf(certificate.get());
  return Context(std::move(impl));
}

Context Context::clientThatKnows(const std::string& fingerprint) {
  constexpr std::size_t kDigits = 64;
  auto impl = std::make_shared<Impl>(TLS_client_method());
  impl->expected = digitsOf(fingerprint);
  const auto isDigit = [](unsigned char c) { return std::isxdigit(c) != 0; };
  if (impl->expected.size() != kDigits || !std::all_of(impl->expected.begin(), impl->expected.end(), isDigit))
    throw Error("TLS: '" + fingerprint + "' is not the SHA-256 of a certificate: 64 hexadecimal digits");
  return Context(std::move(impl));
}

Context Context::clientThatTrusts(const std::string& authoritiesFile, const std::string& host) {
  auto impl = std::make_shared<Impl>(TLS_client_method());
  impl->host = host;
  if (SSL_CTX_load_verify_file(impl->context.get(), authoritiesFile.c_str()) != 1)
    throw Error("TLS: cannot use the authorities '" + authoritiesFile + "': " + reason());
  SSL_CTX_set_verify(impl->context.get(), SSL_VERIFY_PEER, nullptr);
  return Context(std::move(impl));
}

const std::string& Context::fingerprint() const noexcept {
  return impl_->fingerprint;
}

namespace {

// Of a certificate that is checked, OpenSSL's reason does not say what is wrong with it.
std::string whyFailed(const SSL* ssl) {
  const std::string why = reason();
  const long verdict = SSL_get_verify_result(ssl);
  if (verdict == X509_V_OK || (SSL_get_verify_mode(ssl) & SSL_VERIFY_PEER) == 0) return why;
  const bool ofTheTime = verdict == X509_V_ERR_CERT_NOT_YET_VALID || verdict == X509_V_ERR_CERT_HAS_EXPIRED;
  return why + ": " + X509_verify_cert_error_string(verdict) +
         (ofTheTime ? ", or the clock of this machine is wrong" : "");
}

struct Progress {
  enum { waits, done, failed } state = waits;
  std::string why;
};

// As far as the bytes that have arrived lead.
Progress handshake(SSL* ssl) {
  ERR_clear_error();
  const int result = SSL_do_handshake(ssl);
  if (result == 1) return {Progress::done, ""};
  if (SSL_get_error(ssl, result) == SSL_ERROR_WANT_READ) return {};
  return {Progress::failed, whyFailed(ssl)};
}

// Where a server computes its handshakes, and where it goes on with the result.
struct Elsewhere {
  std::shared_ptr<base::Worker> handshakes;  // null: a client, which computes them at once
  net::Loop* loop = nullptr;
};

// OpenSSL works on memory; the bytes travel by the connection underneath, which has the queue, its limits,
// loss detection and pauses.
class TlsConnection final : public net::Connection::Impl, public std::enable_shared_from_this<TlsConnection> {
 public:
  TlsConnection(std::shared_ptr<Context::Impl> context, net::Connection stream, Elsewhere elsewhere)
      : context_(std::move(context)),
        stream_(std::move(stream)),
        elsewhere_(std::move(elsewhere)),
        ssl_(SSL_new(context_->context.get()), SSL_free) {
    if (!ssl_) throw Error("TLS: " + reason());
    SSL_set_bio(ssl_.get(), BIO_new(BIO_s_mem()), BIO_new(BIO_s_mem()));  // which it then owns
    if (context_->isServer) {
      SSL_set_accept_state(ssl_.get());
    } else {
      SSL_set_connect_state(ssl_.get());
      if (!context_->host.empty()) {
        SSL_set_tlsext_host_name(ssl_.get(), context_->host.c_str());
        SSL_set1_host(ssl_.get(), context_->host.c_str());
      }
    }
  }

  void start(net::ConnectionHandlers handlers) override {
    handlers_ = std::make_shared<net::ConnectionHandlers>(std::move(handlers));
    const std::weak_ptr<TlsConnection> weak = weak_from_this();
    const auto own = handlers_;
    stream_.start({.onConnected =
                       [weak] {
                         if (const auto self = weak.lock()) self->shake();
                       },
                   .onBytes =
                       [weak](std::span<const std::byte> bytes) {
                         if (const auto self = weak.lock()) self->receive(bytes);
                       },
                   .onDrained =
                       [own] {
                         if (own->onDrained) own->onDrained();
                       },
                   .onPeerGone =
                       [own](const std::string& why) {
                         if (own->onPeerGone) own->onPeerGone(why);
                       },
                   .onClosed =
                       [weak, own](const std::string& why) {
                         const auto self = weak.lock();
                         if (own->onClosed)
                           own->onClosed(self && !self->failure_.empty() ? self->failure_ : why);
                       }});
  }

  bool sendable() const override { return !closing_ && failure_.empty() && stream_.isOpen(); }

  void send(std::shared_ptr<const net::Buffer> buffer, net::Delivery delivery) override {
    if (!sendable() || !buffer || buffer->empty()) return;
    if (!established_) {
      if (delivery == net::Delivery::lowLatency) return drop(buffer->size());
      waitingBytes_ += buffer->size();
      if (waitingBytes_ > kMostWaiting) return abort("the peer does not finish the TLS handshake");
      waiting_.push_back(std::move(buffer));
      return;
    }
    // What is encrypted must be sent: decide before.
    if (delivery == net::Delivery::lowLatency && stream_.queuedBytes() > 0) return drop(buffer->size());
    encrypt(*buffer);
  }

  void flush() override {
    passOn();
    stream_.flush();
  }

  void close(std::string why) override {
    if (sendable() && established_) {
      SSL_shutdown(ssl_.get());
      passOn();
    }
    closing_ = true;
    stream_.close(std::move(why));
  }
  void abort(std::string why) override { stream_.abort(std::move(why)); }
  void release() noexcept override {
    handlers_.reset();
    stream_ = net::Connection();
  }
  void setPaused(bool paused) override {
    if (paused) {
      stream_.pauseReading();
    } else {
      stream_.resumeReading();
    }
  }
  void setLossDetection(std::chrono::milliseconds lossTimeout, std::chrono::seconds keepAlive) override {
    stream_.setLossDetection(lossTimeout, keepAlive);
  }
  const net::Endpoint& local() const override { return stream_.local(); }
  const net::Endpoint& remote() const override { return stream_.remote(); }
  std::size_t queuedBytes() override { return stream_.queuedBytes(); }
  net::ConnectionStatistics statistics() override {
    net::ConnectionStatistics statistics = stream_.statistics();
    statistics.droppedBuffers += droppedBuffers_;
    statistics.droppedBytes += droppedBytes_;
    return statistics;
  }
  int nativeHandle() override { return stream_.nativeHandle(); }

 private:
  static constexpr std::size_t kMostWaiting = std::size_t{1} << 20;
  static constexpr std::size_t kRecord = 16384;
  // New keys take 50 us, in answer to 27 bytes: a piece has no more of them than take some milliseconds.
  static constexpr std::size_t kPiece = 2048;
  static constexpr std::size_t kFreeKeyUpdates = 32;
  static constexpr std::size_t kBytesForKeys = std::size_t{1} << 20;

  void drop(std::size_t bytes) {
    ++droppedBuffers_;
    droppedBytes_ += bytes;
  }

  void encrypt(std::span<const std::byte> bytes) {
    ERR_clear_error();
    while (!bytes.empty()) {
      std::size_t written = 0;
      if (SSL_write_ex(ssl_.get(), bytes.data(), bytes.size(), &written) != 1)
        return fail("TLS: " + reason());
      bytes = bytes.subspan(written);
    }
  }

  // Moves what OpenSSL has written into the queue of the stream.
  void passOn() {
    if (shaking_) return;
    BIO* const out = SSL_get_wbio(ssl_.get());
    const std::size_t size = BIO_ctrl_pending(out);
    if (size == 0 || !stream_) return;
    auto buffer = std::make_shared<net::Buffer>(size);
    std::size_t taken = 0;
    BIO_read_ex(out, buffer->data(), size, &taken);
    buffer->resize(taken);
    stream_.send(std::move(buffer), net::Delivery::reliable);
  }

  // Until the result is here, nothing else touches what OpenSSL knows of the connection. A job for one that
  // is gone does nothing. One that finds no memory leaves the peer without an answer: it is disconnected as
  // one that never greets.
  void shake() {
    if (!elsewhere_.handshakes) return goOn(handshake(ssl_.get()));
    shaking_ = true;
    elsewhere_.handshakes->postFor(
        stream_.remote().address,
        [weak = weak_from_this(), waiting = std::weak_ptr(ssl_), loop = elsewhere_.loop] {
          const auto ssl = waiting.lock();
          if (!ssl) return;
          loop->post([weak, progress = handshake(ssl.get())] {
            if (const auto self = weak.lock()) self->goOn(progress);
          });
        });
  }

  void goOn(const Progress& progress) {
    shaking_ = false;
    if (closing_ || !stream_) return;
    if (progress.state == Progress::failed) {
      flush();  // the alert names the reason to the peer
      return fail("TLS handshake failed: " + progress.why);
    }
    if (progress.state == Progress::done) {
      if (!isKnown()) return;
      established_ = true;
      SSL_set_msg_callback_arg(ssl_.get(), &keyUpdates_);
      for (const auto& buffer : std::exchange(waiting_, {})) encrypt(*buffer);
      waitingBytes_ = 0;
    }
    flush();
    const auto handlers = handlers_;
    if (established_ && !context_->isServer && handlers && handlers->onConnected) handlers->onConnected();
    if (established_ || !arrived_.empty()) receive(std::exchange(arrived_, {}));
  }

  bool isKnown() {
    if (context_->expected.empty()) return true;
    const Certificate certificate(SSL_get1_peer_certificate(ssl_.get()));
    const std::string fingerprint = fingerprintOf(certificate.get());
    if (digitsOf(fingerprint) == context_->expected) return true;
    fail("the server has another certificate, with the fingerprint " + fingerprint);
    return false;
  }

  void receive(std::span<const std::byte> bytes) {
    if (shaking_) {
      arrived_.insert(arrived_.end(), bytes.begin(), bytes.end());
      if (arrived_.size() > kMostWaiting) abort("more arrives than belongs to a TLS handshake");
      return;
    }
    if (!established_) {
      const auto piece = bytes.first(std::min(bytes.size(), kPiece));
      arrived_.assign(bytes.begin() + static_cast<std::ptrdiff_t>(piece.size()), bytes.end());
      give(piece);
      return shake();
    }
    net::Buffer plain;
    std::optional<std::string> end;  // why
    do {
      const auto piece = bytes.first(std::min(bytes.size(), kPiece));
      bytes = bytes.subspan(piece.size());
      give(piece);
      end = read(plain);
    } while (!bytes.empty() && !end);
    received_ += plain.size();
    flush();  // answers of TLS itself
    const auto handlers = handlers_;
    if (!plain.empty() && handlers && handlers->onBytes) handlers->onBytes(plain);
    if (!end || !stream_) return;
    if (!end->empty()) return fail(*std::move(end));
    closing_ = true;
    stream_.close("closed by the peer");
  }

  void give(std::span<const std::byte> bytes) {
    std::size_t taken = 0;
    if (!bytes.empty()) BIO_write_ex(SSL_get_rbio(ssl_.get()), bytes.data(), bytes.size(), &taken);
  }

  // Appends what has arrived. Why the connection ends, if it does: empty when the peer says so.
  std::optional<std::string> read(net::Buffer& plain) {
    ERR_clear_error();
    std::size_t size = 0;
    do {
      const std::size_t before = plain.size();
      plain.resize(before + kRecord);
      size = 0;
      if (SSL_read_ex(ssl_.get(), plain.data() + before, kRecord, &size) != 1) size = 0;
      plain.resize(before + size);
    } while (size > 0);
    const int state = SSL_get_error(ssl_.get(), 0);
    if (state == SSL_ERROR_ZERO_RETURN) return "";
    if (state != SSL_ERROR_WANT_READ) return "TLS: " + reason();
    if (keyUpdates_ > kFreeKeyUpdates + (received_ + plain.size()) / kBytesForKeys)
      return "the peer asks for new TLS keys again and again";
    return std::nullopt;
  }

  void fail(std::string why) {
    failure_ = std::move(why);
    if (stream_) stream_.close(failure_);
  }

  const std::shared_ptr<Context::Impl> context_;
  net::Connection stream_;
  const Elsewhere elsewhere_;
  const std::shared_ptr<SSL> ssl_;
  bool shaking_ = false;      // the thread of the handshakes has ssl_
  bool established_ = false;  // the handshake is over
  net::Buffer arrived_;       // while shaking
  // Shared, so that the captures of a callback outlive a connection that it destroys.
  std::shared_ptr<net::ConnectionHandlers> handlers_;
  std::vector<std::shared_ptr<const net::Buffer>> waiting_;  // for the end of the handshake
  std::size_t waitingBytes_ = 0;
  std::size_t keyUpdates_ = 0;
  std::size_t received_ = 0;  // bytes, plain
  std::string failure_;
  bool closing_ = false;
  std::uint64_t droppedBuffers_ = 0;
  std::uint64_t droppedBytes_ = 0;
};

}  // namespace

net::Connection wrap(const Context& context, net::Connection stream) {
  return net::Connection(std::make_shared<TlsConnection>(context.impl(), std::move(stream), Elsewhere{}));
}

Acceptor::Acceptor(Context context, net::Loop& loop)
    : context_(std::move(context)), loop_(loop), handshakes_(std::make_shared<base::Worker>("tls")) {}

Acceptor::~Acceptor() {
  handshakes_->stop();
}

net::Connection Acceptor::wrap(net::Connection stream) {
  return net::Connection(
      std::make_shared<TlsConnection>(context_.impl(), std::move(stream), Elsewhere{handshakes_, &loop_}));
}

}  // namespace hapticd::tls
