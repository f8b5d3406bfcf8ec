#include "net/acceptor.h"

#include <cerrno>
#include <system_error>

namespace hapticd::net {
namespace {

bool isShortage(int error) {
  return error == EMFILE || error == ENFILE || error == ENOMEM || error == ENOBUFS;
}

}  // namespace

void Acceptor::close() noexcept {
  open_ = false;
  if (retry_) retry_->cancel();
  if (quiet_) quiet_->cancel();
  loop_.guard([this] { closeSocket(); });
}

void Acceptor::acceptPending() {
  constexpr int kMostPerWake = 8;  // others have their turn in between
  for (int i = 0; i < kMostPerWake && open_; ++i) {
    const int error = acceptOne();
    if (error == EAGAIN || error == EWOULDBLOCK) break;
    if (isShortage(error)) {
      // Linux refuses before it looks at the queue, which may be empty.
      if (connectionWaits()) report(error);
      return retryLater();
    }
    // Any other error belongs to a connection that ended while it waited.
  }
  if (open_) waitForConnection();
}

// The connection stays pending, so waiting for readiness would spin.
void Acceptor::retryLater() {
  constexpr std::chrono::milliseconds kRetry{100};
  retry_ = loop_.after(kRetry, [weak = weak_from_this()] {
    const auto self = weak.lock();
    if (self && self->open_) self->waitForConnection();
  });
}

void Acceptor::report(int error) {
  constexpr std::chrono::seconds kPeriod{1};
  if (quiet_ && quiet_->active()) return;
  quiet_ = loop_.after(kPeriod, [] {});
  loop_.report("cannot accept a connection on " + address() + ": " + std::system_category().message(error));
}

}  // namespace hapticd::net
