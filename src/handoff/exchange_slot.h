// Hands the newest immutable value to a realtime thread, and returns old values to be freed by the publisher.
//
// Protocol, for one publisher and one reader:
//   publish  wraps the value in a node and exchanges it into the mailbox. A node that comes out was never
//            seen by the reader, so publish frees it at once.
//   take     exchanges null into the mailbox. A node that comes out becomes the current one; the previous one
//            stays readable until the next take and then returns through the ring.
//   collect  frees the nodes in the return ring.
// The reader never touches a reference count. It takes no new node while a retired one waits for room in the
// ring, so the ring cannot overflow; every publish empties it.
#pragma once

#include <atomic>
#include <memory>
#include <utility>

#include "handoff/spsc_ring.h"

namespace hapticd::handoff {

/// The newest value for one reader. Only the publisher frees values (in publish(), collect() and the
/// destructor), so it must destroy the slot, after the reader's last use.
template <class T>
class ExchangeSlot {
 public:
  ExchangeSlot() = default;
  ExchangeSlot(const ExchangeSlot&) = delete;
  ExchangeSlot& operator=(const ExchangeSlot&) = delete;
  ~ExchangeSlot() {
    collect();
    delete mailbox_.load(std::memory_order_acquire);
    delete retired_;
    delete current_;
  }

  /// Publisher: makes `value` the newest and frees returned values. Allocates.
  void publish(std::shared_ptr<const T> value) {
    collect();
    delete mailbox_.exchange(new Node{std::move(value)}, std::memory_order_acq_rel);
  }

  /// Publisher: frees returned values; returns how many.
  std::size_t collect() {
    return returned_.consume([](Node* node) { delete node; });
  }

  /// Reader: the newest value, null before the first. Valid until the take() after the one that replaces it,
  /// so that the reader can compare it with its successor. Wait-free: no allocation, no lock.
  const T* take() noexcept {
    if (retired_ != nullptr && returned_.push(retired_)) retired_ = nullptr;
    if (retired_ == nullptr) {
      if (Node* fresh = mailbox_.exchange(nullptr, std::memory_order_acq_rel)) {
        retired_ = current_;
        current_ = fresh;
      }
    }
    return current_ != nullptr ? current_->value.get() : nullptr;
  }

 private:
  struct Node {
    std::shared_ptr<const T> value;
  };
  // Between two collects the reader can take two nodes and still hold one that it retired before.
  static constexpr std::size_t kReturns = 4;

  alignas(64) std::atomic<Node*> mailbox_{nullptr};
  SpscRing<Node*> returned_{kReturns};
  alignas(64) Node* current_ = nullptr;  // the reader's
  Node* retired_ = nullptr;              // the reader's, returned at its next take
};

}  // namespace hapticd::handoff
