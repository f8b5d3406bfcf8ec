// Accepting in turns: what every kind of listener does with the connections that wait for it.
#pragma once

#include <memory>
#include <string>

#include "net/loop_impl.h"

namespace hapticd::net {

/// Accepts a few connections at a time, so that others have their turn in between. While the machine has no
/// descriptor or memory for one more, it reports that once a second and tries again ten times a second.
class Acceptor : public TcpListener::Impl, public std::enable_shared_from_this<Acceptor> {
 public:
  explicit Acceptor(Loop::Impl& loop) : loop_(loop) {}

  /// Begins to accept; call it once.
  void start() { waitForConnection(); }
  void close() noexcept final;

 protected:
  /// Accepts a connection and hands it over. Returns 0 or the errno, EAGAIN when no connection waits.
  virtual int acceptOne() = 0;
  /// Requests one call of acceptPending() as soon as a connection waits; at once when one waits already.
  virtual void waitForConnection() = 0;
  virtual bool connectionWaits() noexcept = 0;
  virtual void closeSocket() noexcept = 0;
  /// Where it listens, for error texts.
  virtual std::string address() const { return local().text(); }

  /// May destroy the owner's TcpListener: the caller keeps this object alive.
  void acceptPending();
  bool isOpen() const noexcept { return open_; }

 private:
  void retryLater();
  void report(int error);

  Loop::Impl& loop_;
  bool open_ = true;
  std::shared_ptr<Subscription::State> retry_;
  std::shared_ptr<Subscription::State> quiet_;  // active: reported a moment ago
};

}  // namespace hapticd::net
