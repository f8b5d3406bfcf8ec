// A value, or an error text.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace hapticd::wire {

/// Why something that a peer sent is refused; the text names the offending value.
struct Error {
  std::string text;
};

/// Outcome of a decode: a T, or an Error. Reading the one that is absent throws std::bad_variant_access.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  /// True when there is a value.
  explicit operator bool() const noexcept { return state_.index() == 0; }
  const T& operator*() const& { return std::get<0>(state_); }
  T&& operator*() && { return std::get<0>(std::move(state_)); }
  const T* operator->() const { return &std::get<0>(state_); }
  /// The error text, when there is no value; throws std::bad_variant_access otherwise.
  const std::string& error() const { return std::get<1>(state_).text; }

 private:
  std::variant<T, Error> state_;
};

/// Success, or an Error.
template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)) {}

  /// True on success.
  explicit operator bool() const noexcept { return !error_; }
  /// The error text, after a failure; throws std::bad_optional_access on success.
  const std::string& error() const { return error_.value().text; }

 private:
  std::optional<Error> error_;
};

}  // namespace hapticd::wire
