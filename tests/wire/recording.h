// The recorded conversations in testdata/wire, and how to compare bytes that VRPN defines.
#pragma once

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "wire/codec.h"
#include "wire/fields.h"
#include "wire/frame.h"

namespace hapticd::wire {

using Bytes = std::vector<std::byte>;

inline Bytes recorded(const std::string& file) {
  std::ifstream in(std::string(HAPTICD_TESTDATA) + "/wire/" + file, std::ios::binary);
  if (!in) throw std::runtime_error("no recording " + file);
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

/// The datagrams of a recording in which each is preceded by its length.
inline std::vector<Bytes> recordedDatagrams(const std::string& file) {
  const Bytes all = recorded(file);
  std::vector<Bytes> datagrams;
  for (std::size_t at = 0; at < all.size();) {
    const auto length = loadBig<std::uint32_t>(all.data() + at);
    const ByteView datagram = ByteView(all).subspan(at + 4, length);
    datagrams.emplace_back(datagram.begin(), datagram.end());
    at += 4 + length;
  }
  return datagrams;
}

/// Counts by message for one direction of an index file, such as "c2s" or "c2s/udp".
inline std::map<std::string, int> recordedCounts(const std::string& file, const std::string& direction) {
  std::ifstream in(std::string(HAPTICD_TESTDATA) + "/wire/" + file);
  std::map<std::string, int> counts;
  for (std::string line; std::getline(in, line);) {
    const std::size_t times = line.rfind('x');
    std::string name = line.substr(10, times - 10);
    name.erase(name.find_last_not_of(' ') + 1);
    if (line.substr(0, line.find(' ')) == direction) counts[name] = std::stoi(line.substr(times + 1));
  }
  return counts;
}

inline Bytes encoded(const Message& message) {
  Bytes bytes(payloadSize(message));
  encodePayload(message, bytes.data());
  return bytes;
}

// Zeroes what lies behind the NUL of a text field: stray memory of the sender.
class StrayMemoryEraser final : public FieldVisitor {
 public:
  explicit StrayMemoryEraser(std::byte* payload) : at_(payload) {}

  void number(const Field&, const Numbers& one) override { at_ += bytesOf(one.type); }
  void array(const Field&, const Numbers& values) override { at_ += bytesOf(values.type) * values.count; }
  void name(const Field&, std::span<char> bytes) override { erase(bytes.size()); }
  void text(const Field&, std::size_t bytes, std::string&) override { erase(bytes); }
  void list(const Field&, const NumberList&) override {}

 private:
  void erase(std::size_t size) {
    std::fill(std::find(at_, at_ + size, std::byte{0}), at_ + size, std::byte{0});
    at_ += size;
  }

  std::byte* at_;
};

inline Bytes withoutStrayMemory(Message message, ByteView payload) {
  Bytes bytes(payload.begin(), payload.end());
  StrayMemoryEraser eraser(bytes.data());
  visitFields(message, eraser);
  return bytes;
}

}  // namespace hapticd::wire
