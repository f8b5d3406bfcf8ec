// The send queue of one connection: immutable buffers in order, and the policy for a slow reader.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace hapticd::net {

/// Bytes that many connections may share; never changed once handed to a send.
using Buffer = std::vector<std::byte>;

/// What happens to a buffer when the peer reads too slowly.
enum class Delivery : std::uint8_t {
  reliable,    ///< Kept until sent, in order.
  lowLatency,  ///< Worthless when late: dropped as a whole while the peer is behind.
};

/// A FIFO that drops low-latency buffers when it is long. Above the low mark, a new low-latency buffer
/// replaces those that wait; if the reliable buffers alone exceed the mark, the new one is dropped, too. A
/// partly sent buffer is never dropped. Not thread-safe.
class SendQueue {
 public:
  explicit SendQueue(std::size_t lowMarkBytes) : lowMarkBytes_(lowMarkBytes) {}

  void push(std::shared_ptr<const Buffer> buffer, Delivery delivery);

  /// Fills `parts` with the next bytes to send, in order, and returns how many parts there are.
  std::size_t gather(std::span<std::span<const std::byte>> parts) const;
  /// Removes the first `bytes` bytes, which were sent.
  void consume(std::size_t bytes);
  void clear();

  bool empty() const { return head_ == items_.size(); }
  std::size_t bytes() const { return bytes_; }
  std::size_t reliableBytes() const { return bytes_ - lowLatencyBytes_; }
  /// Memory that the peer makes this side hold: reliable bytes, and kItemBytes for each buffer, which matters
  /// for many small ones.
  std::size_t cost() const { return reliableBytes() + kItemBytes * (items_.size() - head_); }
  static constexpr std::size_t kItemBytes = 128;
  std::uint64_t droppedBuffers() const { return droppedBuffers_; }
  std::uint64_t droppedBytes() const { return droppedBytes_; }

 private:
  struct Item {
    std::shared_ptr<const Buffer> buffer;
    Delivery delivery;
  };

  void dropWaitingLowLatency();
  void countDrop(std::size_t bytes);

  // A vector with a moving head keeps its storage, so that a queue emptied each tick never allocates.
  std::vector<Item> items_;
  std::size_t head_ = 0;
  std::size_t headSent_ = 0;  // bytes of items_[head_] already sent
  std::size_t bytes_ = 0;
  std::size_t lowLatencyBytes_ = 0;
  std::size_t lowMarkBytes_;
  std::uint64_t droppedBuffers_ = 0;
  std::uint64_t droppedBytes_ = 0;
};

}  // namespace hapticd::net
