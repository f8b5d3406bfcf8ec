#include "wire/fields.h"

#include <array>
#include <concepts>

namespace hapticd::wire {

namespace {

struct TypeRow {
  std::string_view name;
  std::size_t bytes;
};
constexpr std::array<TypeRow, 8> kTypes{
    {{"u8", 1}, {"i16", 2}, {"i32", 4}, {"u32", 4}, {"i64", 8}, {"u64", 8}, {"f32", 4}, {"f64", 8}}};

template <class T, class... Types>
consteval NumberType positionOf() {
  std::uint8_t index = 0;
  (void)((std::same_as<T, Types> || (++index, false)) || ...);
  return NumberType{index};
}
template <Scalar T>
constexpr NumberType kTypeOf = positionOf<T, std::uint8_t, std::int16_t, std::int32_t, std::uint32_t,
                                          std::int64_t, std::uint64_t, float, double>();

template <class T>
Numbers valuesOf(void* list) {
  auto& values = *static_cast<std::vector<T>*>(list);
  return {kTypeOf<T>, values.data(), values.size()};
}
template <class T>
void resizeList(void* list, std::size_t count) {
  static_cast<std::vector<T>*>(list)->resize(count);
}

// From the fields() of a struct to the virtual functions.
struct Adapter {
  FieldVisitor& visitor;

  template <Scalar T>
  void operator()(const char* name, T& value, const char* unit = "") {
    visitor.number({name, unit}, {kTypeOf<T>, &value, 1});
  }
  template <class T, std::size_t N>
  void operator()(const char* name, std::array<T, N>& values, const char* unit = "") {
    visitor.array({name, unit}, {kTypeOf<T>, values.data(), N});
  }
  template <std::size_t N>
  void operator()(const char* name, NameBuffer<N>& buffer, const char* unit = "") {
    visitor.name({name, unit}, buffer.bytes);
  }
  template <std::size_t N>
  void operator()(const char* name, TextBuffer<N>& buffer, const char* unit = "") {
    visitor.text({name, unit}, N, buffer.text);
  }
  template <class Count, class T, std::size_t Max>
  void operator()(const char* name, Counted<Count, T, Max>& list, const char* unit = "") {
    visitor.list({name, unit}, {kTypeOf<Count>, kTypeOf<T>, Max, &list.values, &valuesOf<T>, &resizeList<T>});
  }
};

template <class M>
void visitFieldsOf(void* message, FieldVisitor& visitor) {
  M::fields(*static_cast<M*>(message), Adapter{visitor});
}

using Walker = void (*)(void*, FieldVisitor&);
template <class... M>
constexpr std::array<Walker, kMessageKinds> walkersOf(MessageList<M...>) {
  return {&visitFieldsOf<M>...};
}
constexpr std::array<Walker, kMessageKinds> kWalkers = walkersOf(AllMessages{});

}  // namespace

std::size_t bytesOf(NumberType type) noexcept {
  return kTypes[static_cast<std::size_t>(type)].bytes;
}

std::string_view nameOf(NumberType type) noexcept {
  return kTypes[static_cast<std::size_t>(type)].name;
}

void visitFields(Message& message, FieldVisitor& visitor) {
  kWalkers[static_cast<std::size_t>(message.kind())](message.data(), visitor);
}

}  // namespace hapticd::wire
