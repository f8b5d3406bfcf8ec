// Arrivals that wait for dispatch. Callbacks of the event loop must neither throw nor run the loop; callbacks
// of the user may do both, so they run later, from this queue.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <vector>

#include "wire/bytes.h"
#include "wire/names.h"

namespace hapticd::client {

/// One arrival; its bytes are valid until the next pop().
struct Arrival {
  enum class What : std::uint8_t { message, connected, lost };

  What what = What::message;
  wire::MessageKind kind = wire::kUnknownKind;  ///< of a message
  wire::LocalSender sender{};                   ///< of a message; -1 when unknown
  wire::LocalType type{};                       ///< of a message; -1 when unknown
  wire::Time time{};                            ///< stamp of a message
  std::chrono::system_clock::time_point arrived{};
  wire::ByteView bytes{};  ///< payload of a message, or the reason of a loss
};

/// A queue of arrivals in two halves, one being filled and one being read. Both keep their memory.
class Inbox {
 public:
  void push(Arrival arrival) {
    half_[filling_].offsets.push_back(half_[filling_].bytes.size());
    half_[filling_].bytes.insert(half_[filling_].bytes.end(), arrival.bytes.begin(), arrival.bytes.end());
    half_[filling_].arrivals.push_back(arrival);
  }

  /// Removes and returns the oldest arrival; false when there is none.
  bool pop(Arrival& arrival) {
    if (next_ == reading().arrivals.size()) {
      reading().clear();
      filling_ = 1 - filling_;
      next_ = 0;
      if (reading().arrivals.empty()) return false;
    }
    arrival = reading().arrivals[next_];
    arrival.bytes = {reading().bytes.data() + reading().offsets[next_], arrival.bytes.size()};
    ++next_;
    return true;
  }

  /// Number of arrivals that wait.
  std::size_t waiting() const noexcept {
    return half_[filling_].arrivals.size() + half_[1 - filling_].arrivals.size() - next_;
  }

  /// Payload bytes in the half being filled.
  std::size_t waitingBytes() const noexcept { return half_[filling_].bytes.size(); }

 private:
  struct Half {
    std::vector<Arrival> arrivals;  // of their bytes, only the size counts
    std::vector<std::size_t> offsets;
    std::vector<std::byte> bytes;
    void clear() {
      arrivals.clear();
      offsets.clear();
      bytes.clear();
    }
  };
  Half& reading() noexcept { return half_[1 - filling_]; }

  Half half_[2];
  std::size_t filling_ = 0;
  std::size_t next_ = 0;
};

}  // namespace hapticd::client
