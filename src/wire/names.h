// Names of senders and message types, and their numbers. Each side of a connection numbers its own names; our
// numbers and those of a peer are different C++ types, so that code cannot confuse them.
#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "wire/messages.h"

namespace hapticd::wire {

/// The number of a name in the numbering that Tag stands for.
template <class Tag>
struct Id {
  std::int32_t value = -1;
  friend constexpr auto operator<=>(const Id&, const Id&) = default;
};
using LocalSender = Id<struct LocalSenderTag>;    ///< our number of a device name
using LocalType = Id<struct LocalTypeTag>;        ///< our number of a message name
using RemoteSender = Id<struct RemoteSenderTag>;  ///< a peer's number of a device name
using RemoteType = Id<struct RemoteTypeTag>;      ///< a peer's number of a message name

/// Senders, and likewise types, that one side may describe; the stock library's limit.
inline constexpr std::int32_t kMaxNames = 2000;
/// Longest name without its NUL; the stock library drops peers that send more.
inline constexpr std::size_t kMaxNameBytes = 95;

/// Our number of a message in the table: the same on every connection, so that bytes can be shared between
/// them.
constexpr LocalType localType(MessageKind kind) noexcept {
  return {static_cast<std::int32_t>(kind)};
}
template <WireMessage M>
inline constexpr LocalType kLocalType = localType(kindOf<M>);

/// The names we use, shared by all peers of a process. Starts with every message of the table and no sender.
/// Names are never removed. A peer announces new ones when it next feeds or sends. Not thread safe: one
/// thread owns the names and their peers.
class LocalNames {
 public:
  LocalNames();

  /// The number of this name, new or known. Throws std::invalid_argument for a name that is empty, longer
  /// than kMaxNameBytes or holds a NUL, and std::length_error beyond kMaxNames names.
  LocalSender addSender(std::string_view name);
  /// The same for a message name, which may be one that is not in the table.
  LocalType addType(std::string_view name);

  std::optional<LocalSender> findSender(std::string_view name) const noexcept;
  std::optional<LocalType> findType(std::string_view name) const noexcept;

  /// Names by number.
  const std::vector<std::string>& senders() const noexcept { return senders_; }
  const std::vector<std::string>& types() const noexcept { return types_; }

 private:
  std::vector<std::string> senders_;
  std::vector<std::string> types_;
};

}  // namespace hapticd::wire
