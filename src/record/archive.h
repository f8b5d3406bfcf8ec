// Values as bytes, by the one list of fields that each type has (fields.h, scene/command_info.h).
//
// Big-endian as on the wire; a list starts with its length. Reading trusts no length: missing bytes are an
// error, and memory grows only with the bytes that exist.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "geometry/types.h"
#include "wire/bytes.h"

namespace hapticd::record {

using wire::ByteView;
using wire::Scalar;
using Bytes = std::vector<std::byte>;

template <class T>
concept IsEnum = std::is_enum_v<T>;

/// A vertex or a triangle: nothing but scalars. A mesh has millions of them.
template <class T>
concept Row = std::is_trivially_destructible_v<T> && requires(const T& row) {
  requires Scalar<std::remove_cvref_t<decltype(*row.begin())>>;
};

/// Appends values to bytes.
class Packer {
 public:
  explicit Packer(Bytes& out) : out_(out) {}

  template <class T>
  void operator()(const char* /*name*/, const T& value) {
    put(value);
  }

  template <Scalar T>
  void put(T value) {
    wire::storeBig(grow(sizeof(T)), value);
  }
  void put(bool value) { put(std::uint8_t{value}); }
  template <IsEnum T>
  void put(T value) {
    put(static_cast<std::int32_t>(value));
  }
  void put(const std::string& text) {
    put(static_cast<std::uint32_t>(text.size()));
    const ByteView bytes = std::as_bytes(std::span(text));
    out_.insert(out_.end(), bytes.begin(), bytes.end());
  }
  template <class T>
  void put(const std::vector<T>& list) {
    put(static_cast<std::uint32_t>(list.size()));
    for (const T& item : list) put(item);
  }
  template <Row T>
  void put(const std::vector<T>& list) {
    put(static_cast<std::uint32_t>(list.size()));
    if (list.empty()) return;
    std::byte* to = grow(list.size() * static_cast<std::size_t>(list[0].size()) * sizeof(*list[0].begin()));
    for (const T& row : list) {
      for (const auto value : row) {
        wire::storeBig(to, value);
        to += sizeof(value);
      }
    }
  }
  template <class T, std::size_t N>
  void put(const std::array<T, N>& list) {
    for (const T& item : list) put(item);
  }
  template <class T>
  void put(const std::optional<T>& value) {
    put(value.has_value());
    if (value) put(*value);
  }
  template <class S, int R, int C>
  void put(const Eigen::Matrix<S, R, C>& m) {
    for (Eigen::Index i = 0; i < m.size(); ++i) put(m.data()[i]);
  }
  void put(const geometry::Quat& q) { put(q.coeffs()); }
  void put(const geometry::Affine& t) { put(t.matrix()); }
  template <class T>
  void put(const T& value) requires(std::is_class_v<T>) {
    fields(value, *this);
  }

 private:
  std::byte* grow(std::size_t bytes) {
    const std::size_t at = out_.size();
    out_.resize(at + bytes);
    return out_.data() + at;
  }

  Bytes& out_;
};

/// Takes values from bytes. After the first incomplete value, ok() is false and all further values are zero.
class Unpacker {
 public:
  explicit Unpacker(ByteView bytes) : rest_(bytes) {}

  bool ok() const noexcept { return ok_; }
  ByteView rest() const noexcept { return rest_; }

  template <class T>
  void operator()(const char* /*name*/, T& value) {
    take(value);
  }
  template <class T>
  T next() {
    T value{};
    take(value);
    return value;
  }

  template <Scalar T>
  void take(T& value) {
    if (!has(sizeof(T))) {
      value = T{};
      return;
    }
    value = wire::loadBig<T>(rest_.data());
    rest_ = rest_.subspan(sizeof(T));
  }
  void take(bool& value) { value = next<std::uint8_t>() != 0; }
  template <IsEnum T>
  void take(T& value) {
    value = static_cast<T>(next<std::int32_t>());
  }
  void take(std::string& text) {
    const auto size = next<std::uint32_t>();
    if (!has(size)) return;
    text.assign(reinterpret_cast<const char*>(rest_.data()), size);
    rest_ = rest_.subspan(size);
  }
  template <class T>
  void take(std::vector<T>& list) {
    const auto size = next<std::uint32_t>();
    list.clear();
    if (!has(size)) return;  // an item has at least a byte
    for (std::uint32_t i = 0; i < size && ok_; ++i) take(list.emplace_back());
  }
  template <class T, std::size_t N>
  void take(std::array<T, N>& list) {
    for (T& item : list) take(item);
  }
  template <class T>
  void take(std::optional<T>& value) {
    value.reset();
    if (next<bool>()) take(value.emplace());
  }
  template <class S, int R, int C>
  void take(Eigen::Matrix<S, R, C>& m) {
    for (Eigen::Index i = 0; i < m.size(); ++i) take(m.data()[i]);
  }
  void take(geometry::Quat& q) { take(q.coeffs()); }
  void take(geometry::Affine& t) { take(t.matrix()); }
  template <class T>
  void take(T& value) requires(std::is_class_v<T>) {
    fields(value, *this);
  }

 private:
  bool has(std::size_t bytes) noexcept {
    ok_ = ok_ && rest_.size() >= bytes;
    return ok_;
  }

  ByteView rest_;
  bool ok_ = true;
};

}  // namespace hapticd::record
