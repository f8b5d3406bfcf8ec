#include "wire/vectors.h"

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>

#include "wire/codec.h"
#include "wire/describe.h"
#include "wire/fields.h"
#include "wire/frame_encoder.h"

namespace hapticd::wire {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kAlphabet = "abcdefghijklmnopqrstuvwxyz0123456789 _-";

std::string letters(std::size_t count) {
  std::string text;
  while (text.size() < count) text += kAlphabet[text.size() % kAlphabet.size()];
  return text;
}

// Fills a message with values by which an implementation that confuses fields, types or ends is recognized.
class Filler : public FieldVisitor {
 public:
  void number(const Field&, const Numbers& one) override { fill(one); }
  void array(const Field&, const Numbers& values) override { fill(values); }
  void name(const Field&, std::span<char> bytes) override {
    const std::string text = textOf(bytes.size());
    std::fill(std::copy(text.begin(), text.end(), bytes.begin()), bytes.end(), '\0');
  }
  void text(const Field&, std::size_t bytes, std::string& value) override { value = textOf(bytes - 1); }
  void list(const Field&, const NumberList& list) override {
    list.resize(std::min(list.most, listLength()));
    fill(list.values());
  }

 private:
  virtual void fill(const Numbers& numbers) = 0;
  virtual std::string textOf(std::size_t most) const = 0;
  virtual std::size_t listLength() const = 0;
};

// Every number of the message another one.
class Distinct final : public Filler {
  void fill(const Numbers& numbers) override {
    numbers.with([&]<class T>(std::span<T> values) {
      for (T& value : values) {
        ++count_;
        if constexpr (std::floating_point<T>) {
          value = static_cast<T>(count_ % 2 == 0 ? -count_ : count_) / 8;
        } else if constexpr (std::is_signed_v<T>) {
          value = static_cast<T>(count_ % 2 == 0 ? -257 * count_ : 257 * count_);
        } else {
          value = static_cast<T>(257 * count_);
        }
      }
    });
  }
  std::string textOf(std::size_t) const override { return "spring"; }
  std::size_t listLength() const override { return 30; }

  int count_ = 0;
};

// The ends of each type, from another one on in each message.
class Extreme final : public Filler {
 public:
  explicit Extreme(std::size_t first) : count_(first) {}

 private:
  template <class T>
  T next() {
    using Limits = std::numeric_limits<T>;
    if constexpr (std::floating_point<T>) {
      constexpr std::array kValues{Limits::max(),        Limits::lowest(),  T{-0.0}, Limits::min(),
                                   Limits::denorm_min(), Limits::epsilon(), T{0.1},  T{-1} / 3};
      return kValues[count_++ % kValues.size()];
    } else {
      constexpr std::array kValues{Limits::max(), Limits::min(), T{1}, static_cast<T>(Limits::max() - 1)};
      return kValues[count_++ % kValues.size()];
    }
  }
  void fill(const Numbers& numbers) override {
    numbers.with([&]<class T>(std::span<T> values) {
      for (T& value : values) value = next<T>();
    });
  }
  std::string textOf(std::size_t most) const override { return letters(most); }
  std::size_t listLength() const override { return 256; }

  std::size_t count_;
};

// A number as JSON. 64 bits are text: a reader of JSON may keep numbers as doubles.
template <class T>
Json numberAsJson(T value) {
  if constexpr (sizeof(T) == 8 && std::integral<T>) return std::to_string(value);
  if constexpr (std::floating_point<T>) return static_cast<double>(value);
  return value;
}

class FieldsToJson final : public FieldVisitor {
 public:
  void number(const Field& field, const Numbers& one) override {
    one.with([&](auto values) { json[std::string(field.name)] = numberAsJson(values[0]); });
  }
  void array(const Field& field, const Numbers& values) override { addAll(field, values); }
  void name(const Field& field, std::span<char> bytes) override {
    const std::string_view all(bytes.data(), bytes.size());
    json[std::string(field.name)] = all.substr(0, all.find('\0'));
  }
  void text(const Field& field, std::size_t, std::string& value) override {
    json[std::string(field.name)] = value;
  }
  void list(const Field& field, const NumberList& list) override { addAll(field, list.values()); }

  Json json = Json::object();

 private:
  void addAll(const Field& field, const Numbers& numbers) {
    Json all = Json::array();
    numbers.with([&](auto values) {
      for (const auto value : values) all.push_back(numberAsJson(value));
    });
    json[std::string(field.name)] = std::move(all);
  }
};

std::string hex(ByteView bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::byte byte : bytes) {
    text += kDigits[std::to_integer<unsigned>(byte) >> 4];
    text += kDigits[std::to_integer<unsigned>(byte) & 15];
  }
  return text;
}

// One line of the file.
std::string vectorOf(Message message, Time time, LocalSender sender) {
  FrameEncoder encoder;
  encoder.add(time, sender, message);
  FrameView frame;
  FrameReader(encoder.bytes()).next(frame);
  FieldsToJson fields;
  visitFields(message, fields);
  Json line;
  line["name"] = info(message.kind()).name;
  line["struct"] = structName(message.kind());
  line["fields"] = fields.json;
  line["payload"] = hex(frame.payload);
  line["header"] = {{"length", frame.header.length},     {"seconds", time.seconds},
                    {"microseconds", time.microseconds}, {"sender", sender.value},
                    {"type", frame.header.type},         {"sequence", frame.header.sequence}};
  line["frame"] = hex(encoder.bytes());
  return line.dump();
}

}  // namespace

std::string vectorsAsJson() {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    const MessageKind kind{static_cast<std::uint8_t>(i)};
    const Message defaults(kind);
    lines.push_back(vectorOf(defaults, {0, 0}, LocalSender{0}));
    Message distinct(kind);
    Distinct counting;
    visitFields(distinct, counting);
    if (payloadSize(distinct) == 0) continue;  // no field that could differ
    lines.push_back(vectorOf(distinct, {1700000000, 250000}, LocalSender{1}));
    for (std::size_t first = 0; first < 2; ++first) {
      Message extreme(kind);
      Extreme ends(first);
      visitFields(extreme, ends);
      lines.push_back(vectorOf(extreme, {0xffffffff, 999999}, LocalSender{1999}));
    }
  }
  std::string text = "[\n";
  for (std::size_t i = 0; i < lines.size(); ++i) text += lines[i] + (i + 1 < lines.size() ? ",\n" : "\n]\n");
  return text;
}

}  // namespace hapticd::wire
