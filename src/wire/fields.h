// The fields of a message whose struct is known only at run time: what describes, prints, compares and fills
// any message walks them here, and does not instantiate itself for every struct of the table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "wire/message.h"

namespace hapticd::wire {

/// How a number travels.
enum class NumberType : std::uint8_t { u8, i16, i32, u32, i64, u64, f32, f64 };

/// Bytes of one number, in memory and on the wire.
std::size_t bytesOf(NumberType type) noexcept;
/// "i32" and the like.
std::string_view nameOf(NumberType type) noexcept;

/// Name and unit of a field; the unit is empty when it has none.
struct Field {
  std::string_view name;
  std::string_view unit;
};

/// Numbers of one type in a struct.
struct Numbers {
  NumberType type;
  void* data;
  std::size_t count;

  /// Calls `visit(std::span<T>)` with T as the type says.
  template <class Visit>
  void with(Visit&& visit) const {
    switch (type) {
      case NumberType::u8:
        return visit(std::span(static_cast<std::uint8_t*>(data), count));
      case NumberType::i16:
        return visit(std::span(static_cast<std::int16_t*>(data), count));
      case NumberType::i32:
        return visit(std::span(static_cast<std::int32_t*>(data), count));
      case NumberType::u32:
        return visit(std::span(static_cast<std::uint32_t*>(data), count));
      case NumberType::i64:
        return visit(std::span(static_cast<std::int64_t*>(data), count));
      case NumberType::u64:
        return visit(std::span(static_cast<std::uint64_t*>(data), count));
      case NumberType::f32:
        return visit(std::span(static_cast<float*>(data), count));
      case NumberType::f64:
        return visit(std::span(static_cast<double*>(data), count));
    }
  }
};

/// The list that a message ends in.
struct NumberList {
  NumberType countType;                        ///< of its length
  NumberType type;                             ///< of its values
  std::size_t most;                            ///< longest that is allowed
  void* vector;                                ///< std::vector of values
  Numbers (*view)(void* vector);               ///< see values()
  void (*setSize)(void* vector, std::size_t);  ///< see resize()

  /// The values, valid until the list is resized.
  Numbers values() const { return view(vector); }
  void resize(std::size_t count) const { setSize(vector, count); }
};

/// Gets the fields of a message in wire order, each by the function for its form. It may change them.
class FieldVisitor {
 public:
  virtual ~FieldVisitor() = default;

  virtual void number(const Field& field, const Numbers& one) = 0;
  /// A fixed number of numbers.
  virtual void array(const Field& field, const Numbers& values) = 0;
  /// A NameBuffer: text and zeros behind it.
  virtual void name(const Field& field, std::span<char> bytes) = 0;
  /// A TextBuffer of that many bytes on the wire.
  virtual void text(const Field& field, std::size_t bytes, std::string& value) = 0;
  virtual void list(const Field& field, const NumberList& list) = 0;
};

/// Calls the visitor for each field of the message.
void visitFields(Message& message, FieldVisitor& visitor);

}  // namespace hapticd::wire
