// Messages that a client has sent and that wait for the scene, as bytes in the order of arrival.
#pragma once

#include <cstddef>
#include <vector>

#include "base/time.h"
#include "wire/peer.h"

namespace hapticd::server {

/// First in, first out. Messages of kinds that the table does not know are not kept. Net thread.
class MessageBacklog {
 public:
  /// A message as it was received; its views live until the next call of the backlog.
  struct Entry {
    wire::MessageReceived message;  ///< without the names and numbers of the peer
    base::Nanos received = 0;       ///< when the server read it, on the servo clock
  };

  void push(const wire::MessageReceived& message, base::Nanos received);
  /// The oldest message; the backlog must not be empty.
  Entry pop();

  bool empty() const noexcept { return begin_ == bytes_.size(); }
  /// What it holds, in bytes.
  std::size_t size() const noexcept { return bytes_.size() - begin_; }

 private:
  std::vector<std::byte> bytes_;
  std::size_t begin_ = 0;  // of the oldest message
};

}  // namespace hapticd::server
