// The messages of a client that wait for the scene, as bytes in order of arrival.
#pragma once

#include <cstddef>
#include <vector>

#include "base/time.h"
#include "wire/peer.h"

namespace hapticd::server {

/// FIFO queue of messages of known kinds. Net thread.
class MessageBacklog {
 public:
  /// A message as it was received; its payload stays valid until the next non-const call.
  struct Entry {
    wire::MessageReceived message;  ///< without the sender and type of the remote peer
    base::Nanos received = 0;       ///< when the server read it, on the servo clock
  };

  void push(const wire::MessageReceived& message, base::Nanos received);
  /// The oldest message; the backlog must not be empty.
  Entry pop();

  bool empty() const noexcept { return begin_ == bytes_.size(); }
  /// Size of all entries in bytes, headers included.
  std::size_t size() const noexcept { return bytes_.size() - begin_; }

 private:
  std::vector<std::byte> bytes_;
  std::size_t begin_ = 0;  // of the oldest message
};

}  // namespace hapticd::server
