// The recorded conversations in testdata/wire, and how to compare bytes that VRPN defines.
#pragma once

#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "wire/codec.h"
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

// Zeroes what lies behind the NUL of a text field: stray memory of the sender.
struct StrayMemoryEraser {
  std::byte* at;

  template <Scalar T>
  void operator()(const char*, const T&, const char* = "") {
    at += sizeof(T);
  }
  template <class T, std::size_t N>
  void operator()(const char*, const std::array<T, N>&, const char* = "") {
    at += sizeof(T) * N;
  }
  template <std::size_t N>
  void operator()(const char*, const NameBuffer<N>&, const char* = "") {
    erase(N);
  }
  template <std::size_t N>
  void operator()(const char*, const TextBuffer<N>&, const char* = "") {
    erase(N);
  }
  template <class Count, class T, std::size_t Max>
  void operator()(const char*, const Counted<Count, T, Max>&, const char* = "") {}

  void erase(std::size_t size) {
    std::fill(std::find(at, at + size, std::byte{0}), at + size, std::byte{0});
    at += size;
  }
};

inline Bytes withoutStrayMemory(const Message& message, ByteView payload) {
  Bytes bytes(payload.begin(), payload.end());
  std::visit([&]<class M>(const M& m) { M::fields(m, StrayMemoryEraser{bytes.data()}); }, message);
  return bytes;
}

inline Bytes encoded(const Message& message) {
  return std::visit(
      [](const auto& m) {
        Bytes bytes(payloadSize(m));
        encodePayload(m, bytes.data());
        return bytes;
      },
      message);
}

}  // namespace hapticd::wire
