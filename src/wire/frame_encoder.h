// Messages into frames. Our ids are the same on every connection and receivers ignore sequence numbers, so a
// server encodes a batch of reports once and gives the same bytes to every peer (Peer::sendFrames).
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "wire/codec.h"
#include "wire/frame.h"
#include "wire/names.h"

namespace hapticd::wire {

/// A growing buffer of whole frames, numbered in order. Reuse one: clear() keeps its memory.
class FrameEncoder {
 public:
  /// Appends one message. std::length_error, with nothing appended, when a list in it is too long.
  template <WireMessage M>
  void add(Time time, LocalSender sender, const M& message) {
    encodePayload(message, grow(time, sender.value, kLocalType<M>.value, payloadSize(message)));
  }
  void add(Time time, LocalSender sender, const Message& message) {
    encodePayload(message, grow(time, sender.value, localType(message.kind()).value, payloadSize(message)));
  }
  /// Appends a message of any type, negative system types included, whose payload is already bytes.
  void addRaw(Time time, std::int32_t sender, std::int32_t type, ByteView payload) {
    std::byte* out = grow(time, sender, type, payload.size());
    if (!payload.empty()) std::memcpy(out, payload.data(), payload.size());
  }
  /// Appends bytes that are whole frames (or a cookie) already.
  void append(ByteView bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }

  /// The frames added since the last clear(), valid until the next change.
  ByteView bytes() const noexcept { return bytes_; }
  bool empty() const noexcept { return bytes_.empty(); }
  /// Drops the bytes; sequence numbers continue.
  void clear() noexcept { bytes_.clear(); }
  /// Moves the bytes to `out`, whose old content is dropped and whose memory is reused.
  void swapOut(std::vector<std::byte>& out) noexcept {
    out.clear();
    bytes_.swap(out);
  }

 private:
  std::byte* grow(Time time, std::int32_t sender, std::int32_t type, std::size_t payload) {
    if (payload > kMaxPayloadBytes) {
      throw std::length_error("payload of " + std::to_string(payload) + " bytes, at most " +
                              std::to_string(kMaxPayloadBytes));
    }
    const std::size_t start = bytes_.size();
    bytes_.resize(start + kHeaderBytes + padded(payload));
    const auto length = static_cast<std::uint32_t>(kHeaderBytes + payload);
    storeHeader(bytes_.data() + start, {length, time, sender, type, sequence_++});
    return bytes_.data() + start + kHeaderBytes;
  }

  std::vector<std::byte> bytes_;
  std::uint32_t sequence_ = 0;
};

/// Cuts whole frames into datagrams of at most kMaxDatagramBytes and calls sink(ByteView) with each. A
/// longer frame gets its own datagram, which peers may refuse: send such messages by TCP.
template <class Sink>
void cutDatagrams(ByteView frames, Sink&& sink) {
  std::size_t start = 0;
  std::size_t end = 0;
  FrameReader reader(frames);
  for (FrameView frame; reader.next(frame); end += frame.size) {
    if (end > start && end + frame.size - start > kMaxDatagramBytes) {
      sink(frames.subspan(start, end - start));
      start = end;
    }
  }
  if (end > start) sink(frames.subspan(start, end - start));
}

}  // namespace hapticd::wire
