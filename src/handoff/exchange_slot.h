// Hands the newest immutable value to a realtime thread and takes old ones back to be freed elsewhere.
//
// Protocol, for one publisher and one reader:
//   publish  wraps the value in a node and exchanges it into the mailbox. A node that comes out was never
//            seen by the reader and is freed at once.
//   take     exchanges null into the mailbox. A node that comes out becomes the current one; the one before
//            it stays readable until the next take and then goes back through the return ring.
//   collect  frees what is in the return ring.
// The reader never touches a reference count. It takes nothing new while a returned node waits for room in
// the ring, so the ring cannot overflow; every publish empties it.
#pragma once

#include <atomic>
#include <memory>
#include <utility>

#include "handoff/spsc_ring.h"

namespace hapticd::handoff {

/// The newest value for one reader. The publisher must outlive the reader's use and destroy the slot itself:
/// values are freed by the thread that publishes, collects or destroys, never by the one that takes.
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

  /// Publisher: makes `value` the newest and frees what the reader gave back. Allocates.
  void publish(std::shared_ptr<const T> value) {
    collect();
    delete mailbox_.exchange(new Node{std::move(value)}, std::memory_order_acq_rel);
  }

  /// Publisher: frees what the reader gave back; returns how many.
  std::size_t collect() {
    return returned_.consume([](Node* node) { delete node; });
  }

  /// Reader: the newest value, null before the first. Valid until the take after the one that replaces it, so
  /// the value before it may be used until the next take. Wait-free: no allocation, no lock.
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
  // Between two collects the reader can pick up two nodes and still hold one that it retired before.
  static constexpr std::size_t kReturns = 4;

  alignas(64) std::atomic<Node*> mailbox_{nullptr};
  SpscRing<Node*> returned_{kReturns};
  alignas(64) Node* current_ = nullptr;  // the reader's
  Node* retired_ = nullptr;              // the reader's, given back at its next take
};

}  // namespace hapticd::handoff
