// Frames: the 24-byte header that precedes every payload, and the padding behind it. For callers that loop
// over raw bytes: nothing here allocates or copies.
#pragma once

#include <string>

#include "wire/bytes.h"
#include "wire/types.h"

namespace hapticd::wire {

inline constexpr std::size_t kHeaderBytes = 24;
/// Longest payload accepted or sent: the size of the stock library's buffer. A peer that announces more is
/// disconnected, which bounds the memory that a client can make a connection hold.
inline constexpr std::size_t kMaxPayloadBytes = 64000;
/// Longest datagram sent; it holds whole frames.
inline constexpr std::size_t kMaxDatagramBytes = 1472;

/// Bytes with the padding to the next multiple of 8.
constexpr std::size_t padded(std::size_t bytes) noexcept {
  return (bytes + 7) & ~std::size_t{7};
}

/// The header's fields in wire order. Ids are the sender's own numbers; negative types are system messages.
struct FrameHeader {
  std::uint32_t length = kHeaderBytes;  ///< header and payload, without padding
  Time time;
  std::int32_t sender = 0;
  std::int32_t type = 0;
  std::uint32_t sequence = 0;  ///< for network analysis; receivers ignore it
};

/// One frame inside bytes that the caller owns.
struct FrameView {
  FrameHeader header;
  ByteView payload;
  std::size_t size = 0;  ///< header, payload and padding: where the next frame starts
};

enum class FrameStatus : std::uint8_t {
  kComplete,    ///< a frame, padding included
  kIncomplete,  ///< valid so far: more bytes are needed
  kInvalid      ///< not the start of a frame: see invalidFrame()
};

/// Reads the header at p, which must have kHeaderBytes bytes.
inline FrameHeader loadHeader(const std::byte* p) noexcept {
  return {loadBig<std::uint32_t>(p),
          {loadBig<std::uint32_t>(p + 4), loadBig<std::uint32_t>(p + 8)},
          loadBig<std::int32_t>(p + 12),
          loadBig<std::int32_t>(p + 16),
          loadBig<std::uint32_t>(p + 20)};
}

/// Writes the header to p, which must have room for kHeaderBytes bytes.
inline void storeHeader(std::byte* p, const FrameHeader& header) noexcept {
  storeBig(p, header.length);
  storeBig(p + 4, header.time.seconds);
  storeBig(p + 8, header.time.microseconds);
  storeBig(p + 12, header.sender);
  storeBig(p + 16, header.type);
  storeBig(p + 20, header.sequence);
}

/// Looks for a frame at the start of bytes; fills frame only when complete.
inline FrameStatus readFrame(ByteView bytes, FrameView& frame) noexcept {
  if (bytes.size() < sizeof(std::uint32_t)) return FrameStatus::kIncomplete;
  const auto length = loadBig<std::uint32_t>(bytes.data());
  if (length < kHeaderBytes || length > kHeaderBytes + kMaxPayloadBytes) return FrameStatus::kInvalid;
  const std::size_t size = padded(length);
  if (bytes.size() < size) return FrameStatus::kIncomplete;
  frame = {loadHeader(bytes.data()), bytes.subspan(kHeaderBytes, length - kHeaderBytes), size};
  return FrameStatus::kComplete;
}

/// The reason why readFrame() refused the bytes (at least 4), as an error text.
std::string invalidFrame(ByteView bytes);

/// Iterates over the frames in bytes: `while (reader.next(frame)) ...`, then status() gives the reason for
/// the end.
class FrameReader {
 public:
  explicit FrameReader(ByteView bytes) noexcept : rest_(bytes) {}

  /// Steps to the next frame; false at the end, at an incomplete frame or at an invalid one.
  bool next(FrameView& frame) noexcept {
    status_ = readFrame(rest_, frame);
    if (status_ != FrameStatus::kComplete) return false;
    rest_ = rest_.subspan(frame.size);
    return true;
  }
  /// kIncomplete with an empty rest() is a clean end.
  FrameStatus status() const noexcept { return status_; }
  /// Bytes behind the last complete frame.
  ByteView rest() const noexcept { return rest_; }

 private:
  ByteView rest_;
  FrameStatus status_ = FrameStatus::kIncomplete;
};

}  // namespace hapticd::wire
