// TLS 1.3 around a connection, with the contract of net::Connection.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "base/worker.h"
#include "net/connection.h"
#include "net/loop.h"

namespace hapticd::tls {

/// A certificate or key that cannot be used; the text names the file and the remedy.
class Error : public net::Error {
 public:
  using net::Error::Error;
};

/// A key that cannot be used, or not with the certificate.
class KeyError : public Error {
 public:
  using Error::Error;
};

/// The settings of one side, shared by its connections. Immutable; any thread.
class Context {
 public:
  /// A server with a certificate chain and its key, as PEM files; the key must have mode 0600. Throws Error.
  static Context server(const std::string& certificateFile, const std::string& keyFile);
  /// A server with a key that lives in memory only, and a certificate that clients know by its fingerprint.
  static Context serverWithNewKey();
  /// A client that accepts the one certificate with this fingerprint, as fingerprint() writes it; letters in
  /// either case, colons optional. Throws Error.
  static Context clientThatKnows(const std::string& fingerprint);
  /// A client that accepts certificates for `host` which the authorities in this PEM file have signed. Throws
  /// Error.
  static Context clientThatTrusts(const std::string& authoritiesFile, const std::string& host);

  /// SHA-256 of the server's certificate: 64 hexadecimal digits in pairs with colons.
  const std::string& fingerprint() const noexcept;

  class Impl;
  const std::shared_ptr<Impl>& impl() const noexcept { return impl_; }

 private:
  explicit Context(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
  std::shared_ptr<Impl> impl_;
};

/// Puts TLS around a connection of a client that is not yet started. Bytes sent before the end of the
/// handshake wait for it. Low-latency buffers are dropped as a whole while the peer is behind. A failed
/// handshake ends the connection; the reason names the certificate that was refused.
net::Connection wrap(const Context& context, net::Connection stream);

/// Does the same for the connections of a server. A thread of its own computes the handshakes. For the thread
/// of the loop, which must outlive it.
class Acceptor {
 public:
  Acceptor(Context context, net::Loop& loop);
  /// Handshakes that are under way never end.
  ~Acceptor();
  Acceptor(const Acceptor&) = delete;
  Acceptor& operator=(const Acceptor&) = delete;

  net::Connection wrap(net::Connection stream);
  const std::string& fingerprint() const noexcept { return context_.fingerprint(); }

 private:
  const Context context_;
  net::Loop& loop_;
  const std::shared_ptr<base::Worker> handshakes_;
};

}  // namespace hapticd::tls
