// Payloads: message structs to bytes and back. Everything here follows from fields() of each struct, see
// messages.h. A fixed-size message is checked by its length alone and decodes without allocating; a message
// that ends in a counted list may have bytes behind the list, which are ignored as VRPN ignores them.
#pragma once

#include <cmath>
#include <stdexcept>
#include <string>

#include "wire/bytes.h"
#include "wire/message.h"
#include "wire/result.h"

namespace hapticd::wire {

namespace detail {

// Out of line, so that decode() of a small message can be inlined.
Error wrongSize(std::string_view name, std::size_t got, std::size_t expected, bool at_least);
std::string wrongCount(std::string_view field, double count, std::size_t room, std::size_t most);
std::string tooLong(std::string_view field, std::size_t count, std::size_t most);

// Bytes of the values in the list that a message ends in; its other fields count in kPayloadSize.
struct ListSizeVisitor {
  std::size_t bytes = 0;

  template <class T>
  void operator()(const char*, const T&, const char* = "") {}
  template <class Count, class T, std::size_t Max>
  void operator()(const char* name, const Counted<Count, T, Max>& list, const char* = "") {
    if (list.values.size() > Max) throw std::length_error(tooLong(name, list.values.size(), Max));
    bytes += sizeof(T) * list.values.size();
  }
};

struct Writer {
  std::byte* out;

  template <Scalar T>
  void operator()(const char*, const T& value, const char* = "") {
    storeBig(out, value);
    out += sizeof(T);
  }
  template <class T, std::size_t N>
  void operator()(const char*, const std::array<T, N>& values, const char* = "") {
    for (const T& value : values) (*this)("", value);
  }
  template <std::size_t N>
  void operator()(const char*, const NameBuffer<N>& name, const char* = "") {
    std::memcpy(out, name.bytes.data(), N);
    out += N;
  }
  template <std::size_t N>
  void operator()(const char*, const TextBuffer<N>& buffer, const char* = "") {
    const std::size_t length = std::min(buffer.text.size(), N - 1);
    std::memcpy(out, buffer.text.data(), length);
    std::memset(out + length, 0, N - length);
    out += N;
  }
  template <class Count, class T, std::size_t Max>
  void operator()(const char*, const Counted<Count, T, Max>& list, const char* = "") {
    (*this)("", static_cast<Count>(list.values.size()));
    for (const T& value : list.values) (*this)("", value);
  }
};

// Trusts that the fixed part is there; only a list looks at what is left.
struct Reader {
  const std::byte* in;
  const std::byte* end;
  std::string* error;  // where a list complains

  template <Scalar T>
  void operator()(const char*, T& value, const char* = "") {
    value = loadBig<T>(in);
    in += sizeof(T);
  }
  template <class T, std::size_t N>
  void operator()(const char*, std::array<T, N>& values, const char* = "") {
    for (T& value : values) (*this)("", value);
  }
  template <std::size_t N>
  void operator()(const char*, NameBuffer<N>& name, const char* = "") {
    name = NameBuffer<N>(text(N));
  }
  template <std::size_t N>
  void operator()(const char*, TextBuffer<N>& buffer, const char* = "") {
    const std::string_view all = text(N);
    buffer.text = all.substr(0, all.find('\0'));
  }
  template <class Count, class T, std::size_t Max>
  void operator()(const char* name, Counted<Count, T, Max>& list, const char* = "") {
    Count count{};
    (*this)("", count);
    // As a double, so that one comparison serves every type VRPN counts in: NaN, fractions and negatives fail
    // it.
    const auto n = static_cast<double>(count);
    const auto room = static_cast<std::size_t>(end - in) / sizeof(T);
    if (!(n >= 0 && n <= static_cast<double>(std::min(Max, room)) && n == std::floor(n))) {
      *error = wrongCount(name, n, room, Max);
      return;
    }
    list.values.resize(static_cast<std::size_t>(n));
    for (T& value : list.values) (*this)("", value);
  }

  std::string_view text(std::size_t size) {
    const std::string_view all(reinterpret_cast<const char*>(in), size);
    in += size;
    return all;
  }
};

// Sizes from the types of the fields alone, which it never reads.
struct EmptySizeVisitor {
  std::size_t bytes = 0;
  bool counted = false;

  template <Scalar T>
  constexpr void operator()(const char*, const T&, const char* = "") {
    bytes += sizeof(T);
  }
  template <class T, std::size_t N>
  constexpr void operator()(const char*, const std::array<T, N>&, const char* = "") {
    bytes += sizeof(T) * N;
  }
  template <std::size_t N>
  constexpr void operator()(const char*, const NameBuffer<N>&, const char* = "") {
    bytes += N;
  }
  template <std::size_t N>
  constexpr void operator()(const char*, const TextBuffer<N>&, const char* = "") {
    bytes += N;
  }
  template <class Count, class T, std::size_t Max>
  constexpr void operator()(const char*, const Counted<Count, T, Max>&, const char* = "") {
    bytes += sizeof(Count);
    counted = true;
  }
};

// A place for fields() to name members of. The message is never constructed, because clang 14 has no constant
// std::string.
template <class M>
union Unconstructed {
  constexpr Unconstructed() : none{} {}
  constexpr ~Unconstructed() {}
  char none;
  M message;
};

template <class M>
constexpr EmptySizeVisitor emptySize() {
  EmptySizeVisitor size;
  Unconstructed<M> place;
  M::fields(place.message, size);
  return size;
}

}  // namespace detail

/// Payload bytes of a message without padding; of a counted one, with an empty list.
template <WireMessage M>
inline constexpr std::size_t kPayloadSize = detail::emptySize<M>().bytes;

/// Whether the message ends in a list, so that kPayloadSize is only its smallest size.
template <WireMessage M>
inline constexpr bool kIsCounted = detail::emptySize<M>().counted;

/// Payload bytes of this message without padding; std::length_error when a list is longer than its type
/// allows.
template <WireMessage M>
std::size_t payloadSize(const M& message) {
  if constexpr (!kIsCounted<M>) {
    return kPayloadSize<M>;
  } else {
    detail::ListSizeVisitor list;
    M::fields(message, list);
    return kPayloadSize<M> + list.bytes;
  }
}

/// Writes payloadSize(message) bytes to out.
template <WireMessage M>
void encodePayload(const M& message, std::byte* out) {
  M::fields(message, detail::Writer{out});
}

/// Reads one payload. The fast path: no look-up, and no allocation for fixed-size messages other than Text.
template <WireMessage M>
Result<M> decode(ByteView payload) {
  const bool fits = kIsCounted<M> ? payload.size() >= kPayloadSize<M> : payload.size() == kPayloadSize<M>;
  if (!fits) return detail::wrongSize(M::kInfo.name, payload.size(), kPayloadSize<M>, kIsCounted<M>);
  M message;
  std::string error;
  M::fields(message, detail::Reader{payload.data(), payload.data() + payload.size(), &error});
  if (kIsCounted<M> && !error.empty()) return Error{std::string(M::kInfo.name) + ": " + error};
  return message;
}

/// Same on the wire, which also holds for NaNs of the same bits.
template <WireMessage M>
bool operator==(const M& a, const M& b) {
  const std::size_t size = payloadSize(a);
  if (size != payloadSize(b)) return false;
  std::vector<std::byte> bytes(2 * size);
  encodePayload(a, bytes.data());
  encodePayload(b, bytes.data() + size);
  return std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size),
                    bytes.begin() + static_cast<std::ptrdiff_t>(size));
}

}  // namespace hapticd::wire
