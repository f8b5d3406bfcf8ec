// Big-endian scalars in memory: the lowest layer of the wire.
#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>

namespace hapticd::wire {

/// Bytes that the caller owns; valid while the owner keeps them.
using ByteView = std::span<const std::byte>;

/// A number that travels as sizeof(T) big-endian bytes: integers two's complement, floats IEEE 754.
template <class T>
concept Scalar = (std::integral<T> || std::floating_point<T>)&&!std::same_as<T, bool> && sizeof(T) <= 8;

namespace detail {

template <std::size_t Size>
using UnsignedOf =
    std::conditional_t<Size == 1, std::uint8_t,
                       std::conditional_t<Size == 2, std::uint16_t,
                                          std::conditional_t<Size == 4, std::uint32_t, std::uint64_t>>>;

// Straight-line shifts, because compilers turn these (and not loops) into one byte-swapping instruction.
template <class U, std::size_t... I>
U loadBytes(const std::byte* p, std::index_sequence<I...>) noexcept {
  return static_cast<U>(((static_cast<std::uint64_t>(p[I]) << (8 * (sizeof(U) - 1 - I))) | ...));
}
template <class U, std::size_t... I>
void storeBytes(std::byte* p, U value, std::index_sequence<I...>) noexcept {
  ((p[I] = static_cast<std::byte>(static_cast<std::uint64_t>(value) >> (8 * (sizeof(U) - 1 - I)))), ...);
}

}  // namespace detail

/// Reads sizeof(T) big-endian bytes at p, which needs no alignment.
template <Scalar T>
T loadBig(const std::byte* p) noexcept {
  using U = detail::UnsignedOf<sizeof(T)>;
  return std::bit_cast<T>(detail::loadBytes<U>(p, std::make_index_sequence<sizeof(T)>{}));
}

/// Writes sizeof(T) big-endian bytes at p, which needs no alignment.
template <Scalar T>
void storeBig(std::byte* p, T value) noexcept {
  using U = detail::UnsignedOf<sizeof(T)>;
  detail::storeBytes<U>(p, std::bit_cast<U>(value), std::make_index_sequence<sizeof(T)>{});
}

}  // namespace hapticd::wire
